// Distribution of live frames over several multicast groups by pulse ([network] frame_groups), so
// that a node receives only the frames of pulses that it reconstructs.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <set>
#include <vector>

namespace v3d {

/// Assigns sequence numbers to the live frames of one camera.
///
/// Every group has its own numbers, so that a receiver of some groups sees no gaps. The sequence
/// numbers of group g of n are g, g + n, g + 2 n and so on.
class FrameNumbers {
 public:
  explicit FrameNumbers(size_t groups) : next_(groups) {}

  /// The sequence number of the next frame, which shows `pulse`. A negative pulse counts as 0.
  int64_t next(int64_t pulse) {
    const size_t group = group_of(pulse, next_.size());
    return next_[group]++ * std::ssize(next_) + static_cast<int64_t>(group);
  }

  /// The index of the group that carries frames of `pulse`, below `groups`.
  static size_t group_of(int64_t pulse, size_t groups) {
    return static_cast<size_t>(std::max<int64_t>(pulse, 0)) % groups;
  }

 private:
  std::vector<int64_t> next_;
};

/// Indices of groups, each below the number of groups.
using FrameGroupSet = std::set<size_t>;

inline FrameGroupSet all_frame_groups(size_t groups) {
  FrameGroupSet all;
  for (size_t group = 0; group < groups; ++group) all.insert(all.end(), group);
  return all;
}

}  // namespace v3d
