// Fills small holes in the foreground of a mask.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "base/core/union_find.h"
#include "base/image/mask.h"
#include "base/image/mask_components.h"

namespace v3d {

/// Keeps its working memory between masks. Not thread-safe.
class MaskHoles {
 public:
  /// Fills 4-connected background pieces of fewer than `max_hole` pixels that do not touch the
  /// border. `runs` are the foreground runs of the mask, sorted by row, then by column. Empty runs
  /// are ignored.
  void fill_small(Mask& mask, std::span<const Run> runs, int max_hole);

 private:
  void find_gaps(std::span<const Run> runs);
  void join_touching();
  void join_rows(size_t above, size_t here, size_t end);

  /// Background between two runs of a row, and left and right of all runs. The outer gaps belong to
  /// the outside.
  std::vector<Run> gaps_;
  std::vector<int64_t> area_;
  UnionFind sets_;
};

}  // namespace v3d
