// Joins tracked segments to motion.v3d.
#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <string>
#include <vector>

#include "codec/motion_codec.h"
#include "v3dctl/motion/motion_part.h"
#include "v3dctl/motion/take_motion.h"

namespace v3d::ctl {

/// A motion file and the report about it. One thread.
class MotionFile {
 public:
  /// `pulses`: of the input. Both are borrowed.
  MotionFile(const TrackRequest& request, const std::vector<int64_t>& pulses);

  /// Adds the next segment. Where the file has no room for all its pulses, it gets the first of
  /// them, for which `segment` returns the tracked segment; then the result is false, and the file
  /// is complete. Throws InputError for a segment that exceeds the limits of the format.
  bool add(const MotionPart& part, const std::function<recon::TrackedSegment()>& segment);
  /// The report after the last segment, with the pulses that are not tracked.
  TrackReport finish(std::span<const recon::UntrackedPulses> untracked);

  const std::string& bytes() const { return bytes_; }

 private:
  [[noreturn]] void reject(int64_t first_pulse) const;
  void append(const MotionPart& part);
  void leave_out_after_last(const std::vector<int64_t>& pulses);

  const TrackRequest& request_;
  const std::vector<int64_t>& pulses_;
  codec::MotionWriter writer_;
  int64_t last_pulse_ = -1;  ///< in the file
  TrackReport report_;
  std::string bytes_;
};

}  // namespace v3d::ctl
