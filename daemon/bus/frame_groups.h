// Live frames, spread over several multicast groups by pulse ([network] frame_groups), so that a
// node which reconstructs some of the pulses need not hear the others.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <set>
#include <vector>

namespace v3d {

/// Of the live frames of one camera, how many a group has had before.
///
/// Every group has numbers of its own, so that who does not hear one group misses nothing in the
/// others: the sequence numbers of group g of n are g, g + n, g + 2 n and so on.
class FrameNumbers {
 public:
  explicit FrameNumbers(size_t groups) : next_(groups) {}

  /// The sequence number of the next frame, which is of `pulse`; one without a number counts as 0.
  int64_t next(int64_t pulse) {
    const size_t group = group_of(pulse, next_.size());
    return next_[group]++ * std::ssize(next_) + static_cast<int64_t>(group);
  }

  static size_t group_of(int64_t pulse, size_t groups) {
    return static_cast<size_t>(std::max<int64_t>(pulse, 0)) % groups;
  }

 private:
  std::vector<int64_t> next_;
};

/// Numbers 0 to n - 1.
using FrameGroupSet = std::set<size_t>;

inline FrameGroupSet all_frame_groups(size_t groups) {
  FrameGroupSet all;
  for (size_t group = 0; group < groups; ++group) all.insert(all.end(), group);
  return all;
}

}  // namespace v3d
