#include "recon/motion/motion_tracker.h"

#include <algorithm>
#include <utility>

#include "recon/motion/segment_tracker.h"
#include "recon/pipeline/compact_frame.h"

namespace v3d::recon {

namespace {

/// `key`: index of the key pulse in the take.
SegmentExtent extent_of(const TrackedSegment& segment, size_t key) {
  const size_t from = key - segment.key;
  return {from, from + segment.pulses.size() - (segment.shares_last ? 1 : 0)};
}

}  // namespace

RangeTracker::RangeTracker(const TakeSource& take, const TakeSurvey& survey,
                           const TrackingOptions& options, const OnPulse& on_pulse)
    : take_(take),
      options_(options),
      watched_([this, &on_pulse](size_t i) {
        on_pulse(i);
        return take_.pulses(i);
      }),
      keys_(survey, take.pulses, on_pulse) {}

TrackedRange RangeTracker::track(const SegmentRange& range) {
  const size_t key = keys_.best_key(range);
  TrackedRange tracked{.segment = track_segment(watched_, range.first, key, range.last, range.limit,
                                                options_, take_.colours),
                       .extent = {}};
  tracked.extent = extent_of(tracked.segment, key);
  return tracked;
}

codec::MotionSegment motion_segment(const TrackedSegment& segment) {
  codec::MotionSegment result;
  result.pulses = segment.pulses;
  result.key = segment.key;
  result.triangles = segment.surface.triangles;
  for (const auto& positions : segment.positions) {
    result.positions.push_back(vertex_positions(positions));
  }
  result.confidences = segment.confidences;
  return result;
}

TrackedMotion track_motion(const TakeSource& take, size_t count, const TrackingOptions& options,
                           const OnPulse& on_pulse) {
  const TakeSurvey survey = survey_pulses(take.surfaces, count, on_pulse);
  TakeIntervals intervals = intervals_of(survey);
  RangeTracker tracker(take, survey, options, on_pulse);
  TrackedMotion motion;
  motion.untracked = std::move(intervals.untracked);
  for (std::vector<SegmentRange> open = std::move(intervals.tracked); !open.empty();) {
    const SegmentRange range = open.back();
    open.pop_back();
    TrackedRange tracked = tracker.track(range);
    for (const SegmentRange& rest : rest_of(range, tracked.extent)) open.push_back(rest);
    motion.segments.push_back(std::move(tracked.segment));
  }
  std::ranges::sort(motion.segments, {}, [](const TrackedSegment& s) { return s.pulses[0]; });
  return motion;
}

}  // namespace v3d::recon
