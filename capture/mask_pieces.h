// Connected pieces of a mask, as runs of its rows that touch.
#pragma once

#include <cstddef>
#include <vector>

#include "base/mask.h"

namespace v3d {

/// Pixels [begin, end) of row y.
struct Run {
  int y = 0;
  int begin = 0;
  int end = 0;
};

/// From the top row to the bottom, each from left to right.
std::vector<Run> foreground_runs(const Mask& mask);
std::vector<Run> background_runs(const Mask& mask);

void clear_run(Mask& mask, const Run& run);

enum class Touch { kFourNeighbours, kEightNeighbours };

/// Which runs belong together (union-find).
class Pieces {
 public:
  /// Requires runs in the order above.
  Pieces(const std::vector<Run>& runs, Touch touch);

  /// The first run of the piece to which `run` belongs: the piece's name.
  size_t piece_of(size_t run);

 private:
  void join(size_t a, size_t b);

  std::vector<size_t> parent_;
};

}  // namespace v3d
