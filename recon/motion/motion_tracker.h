// Tracking of a whole take: key pulses, and the segments around them.
#pragma once

#include <vector>

#include "codec/motion_codec.h"
#include "recon/motion/segment_plan.h"
#include "recon/motion/segment_tracker.h"

namespace v3d::recon {

struct TrackedMotion {
  /// By ascending pulses. Two segments share a pulse only as TrackedSegment::shares_last says.
  std::vector<TrackedSegment> segments;
  std::vector<UntrackedPulses> untracked;  ///< ascending
};

/// The pulses of a take, as the tracker reads them.
struct TakeSource {
  PulseSource pulses;
  /// The same pulses without images, for the choice of key pulses. Each has at least the cameras
  /// of `pulses`, with silhouettes that cover at least theirs, such as the whole image. So
  /// KeyQuality::score() is not below that of `pulses`.
  PulseSource surfaces;
  SurfaceColours colours{};  ///< null: the tracked surfaces get no colours
};

/// The segment of a range, and what it covers.
struct TrackedRange {
  TrackedSegment segment;
  SegmentExtent extent;
};

/// Tracks one range of a take after the other. The segment of a range depends on the take and the
/// range alone, so several processes can track the ranges of a take. One caller at a time; works in
/// the caller's TBB arena. Deterministic: independent of thread count.
class RangeTracker {
 public:
  /// All arguments are borrowed. `survey`: survey_pulses() of the take.
  RangeTracker(const TakeSource& take, const TakeSurvey& survey, const TrackingOptions& options,
               const OnPulse& on_pulse);

  /// track_segment() from the best key pulse of `range`, an interval of the survey or rest_of()
  /// one.
  TrackedRange track(const SegmentRange& range);

 private:
  const TakeSource& take_;
  const TrackingOptions& options_;
  const PulseSource watched_;  ///< the take's pulses, reported before they are read
  KeyChooser keys_;
};

/// Tracks the pulses 0 to `count` - 1 of `take`. Pulses without a surface separate intervals, and
/// so do gaps of ten or more lost pulses. In each, the best key pulse begins a segment
/// (track_segment()); what the segment leaves uncovered is tracked in the same way. Every pulse
/// with a surface is in a segment, if need be alone. A pulse without cameras counts as seen as
/// little as any pulse with cameras, so that it is a key pulse only where no other is as good.
///
/// Works in the caller's TBB arena. Deterministic: independent of thread count.
TrackedMotion track_motion(const TakeSource& take, size_t count, const TrackingOptions& options,
                           const OnPulse& on_pulse);

/// The segment as MotionWriter takes it, without its colours.
codec::MotionSegment motion_segment(const TrackedSegment& segment);

}  // namespace v3d::recon
