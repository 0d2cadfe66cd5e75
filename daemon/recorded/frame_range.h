// A range of frame numbers of a take.
#pragma once

#include <cstdint>
#include <limits>

namespace v3d {

/// Frames by number (the pulse, counted from 0): begin <= n < end.
struct FrameRange {
  int64_t begin = 0;
  int64_t end = std::numeric_limits<int64_t>::max();
  bool contains(int64_t frame) const { return frame >= begin && frame < end; }
  friend bool operator==(const FrameRange&, const FrameRange&) = default;
};

}  // namespace v3d
