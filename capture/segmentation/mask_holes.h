// Holes in a mask's foreground.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "base/core/union_find.h"
#include "base/image/mask.h"
#include "base/image/mask_components.h"

namespace v3d {

/// Keeps its working memory between masks. One thread.
class MaskHoles {
 public:
  /// Fills pieces of background (four neighbours) of fewer than `max_hole` pixels that do not touch
  /// the border. `runs` are those of the mask, from the top row to the bottom, each from left to
  /// right; empty ones are passed over.
  void fill_small(Mask& mask, std::span<const Run> runs, int max_hole);

 private:
  void find_gaps(std::span<const Run> runs);
  void join_touching();
  void join_rows(size_t above, size_t here, size_t end);

  /// Background between two runs of a row, and to both sides of all: what lies there belongs to the
  /// outside.
  std::vector<Run> gaps_;
  std::vector<int64_t> area_;
  UnionFind sets_;
};

}  // namespace v3d
