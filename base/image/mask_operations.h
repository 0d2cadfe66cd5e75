// Morphology and components of masks.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "base/core/union_find.h"
#include "base/image/mask.h"

namespace v3d {

// Set operations and morphology on masks.

/// Intersection. Requires equal sizes, like all functions of two masks here.
Mask intersection_of(Mask a, const Mask& b);
/// Set difference: pixels of `a` that are not in `b`.
Mask difference_of(Mask a, const Mask& b);
/// Union.
Mask union_of(Mask a, const Mask& b);

/// Largest radius of the functions below, pixels.
inline constexpr int kMaxRadius = 63;

/// Dilation by a square: every pixel within `radius` rows and columns of a foreground pixel.
/// Requires 0 <= radius <= kMaxRadius, like the functions below.
Mask dilate(const Mask& mask, int radius);
/// Erosion by a square: every pixel for which all pixels within `radius` rows and columns are
/// foreground. Pixels outside the image count as foreground.
Mask erode(const Mask& mask, int radius);
/// Morphological opening by a square: removes parts narrower than 2 * radius + 1 pixels.
Mask open(const Mask& mask, int radius);

// Connected components of a mask's foreground, as runs of pixels in rows.

/// Pixels [begin, end) of row y.
struct Run {
  int y = 0;
  int begin = 0;
  int end = 0;
};

/// Appends the foreground runs of a mask row, from left to right.
void append_runs(std::span<const uint64_t> row, int y, std::vector<Run>& runs);

/// Connected components of one mask (8-connected). Found once, and shared by all filters that
/// remove components. Keeps its working memory between masks. Use from one thread.
class MaskComponents {
 public:
  /// Finds the components of `mask`; replaces the previous ones.
  void find(const Mask& mask);

  /// All runs, from the top row to the bottom, each row from left to right. Runs of dropped
  /// components are empty.
  std::span<const Run> runs() const { return runs_; }

  size_t count() const { return pieces_.size(); }
  /// Area of a component, pixels.
  int64_t area(size_t piece) const { return pieces_[piece].area; }
  /// Calls f for the runs of a component, from top to bottom, until f returns false.
  template <class F>
  void for_each_run(size_t piece, F f) const {
    for (uint32_t r = pieces_[piece].first; r != kNone && f(runs_[r]); r = next_[r]) continue;
  }

  /// Clears the component in `mask`, which must be the mask passed to find().
  void drop(size_t piece, Mask& mask);

 private:
  static constexpr uint32_t kNone = ~uint32_t{0};
  struct Piece {
    uint32_t first = kNone;  ///< index of its first run
    uint32_t last = kNone;
    int64_t area = 0;
  };

  void join_touching();
  void gather();

  std::vector<Run> runs_;
  std::vector<uint32_t> next_;      ///< per run: the next run of the same component
  std::vector<uint32_t> piece_of_;  ///< per run: its component
  std::vector<Piece> pieces_;
  UnionFind sets_;
};

}  // namespace v3d
