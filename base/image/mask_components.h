// Connected pieces of a mask's foreground, as runs of its rows that touch.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "base/core/union_find.h"
#include "base/image/mask.h"

namespace v3d {

/// Pixels [begin, end) of row y.
struct Run {
  int y = 0;
  int begin = 0;
  int end = 0;
};

/// Appends the runs of foreground of a row of a mask, from left to right.
void append_runs(std::span<const uint64_t> row, int y, std::vector<Run>& runs);

/// The pieces of one mask (eight neighbours), found once for every clean-up that goes by pieces.
/// Keeps its working memory between masks. One thread.
class MaskComponents {
 public:
  void find(const Mask& mask);

  /// From the top row to the bottom, each from left to right. Those of dropped pieces are empty.
  std::span<const Run> runs() const { return runs_; }

  size_t count() const { return pieces_.size(); }
  /// Pixels.
  int64_t area(size_t piece) const { return pieces_[piece].area; }
  /// Calls f for the runs of a piece, from top to bottom, until it returns false.
  template <class F>
  void for_each_run(size_t piece, F f) const {
    for (uint32_t r = pieces_[piece].first; r != kNone && f(runs_[r]); r = next_[r]) continue;
  }

  /// Clears the piece in the mask it was found in.
  void drop(size_t piece, Mask& mask);

 private:
  static constexpr uint32_t kNone = ~uint32_t{0};
  struct Piece {
    uint32_t first = kNone;  ///< its runs
    uint32_t last = kNone;
    int64_t area = 0;
  };

  void join_touching();
  void gather();

  std::vector<Run> runs_;
  std::vector<uint32_t> next_;      ///< per run: the next one of the same piece
  std::vector<uint32_t> piece_of_;  ///< per run
  std::vector<Piece> pieces_;
  UnionFind sets_;
};

}  // namespace v3d
