// Plan of the segments of a take: which pulses can be tracked independently, and their key pulses.
#pragma once

#include <compare>
#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "recon/motion/segment_tracker.h"

namespace v3d::recon {

/// Pulses from one to the next in a segment. Farther apart, points of the surface are not known to
/// correspond.
inline constexpr int64_t kMaxPulseStep = 10;

/// How well the mesh of a pulse serves as a template.
struct KeyQuality {
  double area_m2 = 0;                ///< of the surface
  std::optional<double> seen_share;  ///< part that at least two cameras see; empty without cameras
  int components = 0;                ///< connected components; 0: no surface
  double handles = 0;  ///< genus: openings between parts that touch, and tunnels of bad surface

  /// Seen area, less what each component and handle costs. More is better. Without cameras, the
  /// part `share_without_cameras` counts as seen. Empty for a pulse without a surface.
  std::optional<double> score(double share_without_cameras) const;
};

/// Source: Collet et al., High-quality streamable free-viewpoint video, SIGGRAPH 2015, section 5
/// (choice of key frames by area and genus). Here only seen area counts. Works in the caller's TBB
/// arena.
KeyQuality key_quality(const ObservedPulse& observed);

/// Called before work on a pulse of a take: its index. May throw to end the tracking.
using OnPulse = std::function<void(size_t index)>;

/// Pulses without a tracked surface.
struct UntrackedPulses {
  size_t first = 0, last = 0;  ///< indices of the take's pulses
  std::string reason;
};

/// The pulses of a take without their images.
struct TakeSurvey {
  std::vector<int64_t> pulses;        ///< numbers, ascending
  std::vector<KeyQuality> qualities;  ///< of each pulse; an upper bound where it has cameras
};

/// Surveys the pulses 0 to `count` - 1 of `surfaces` (TakeSource::surfaces). Works in the caller's
/// TBB arena.
TakeSurvey survey_pulses(const PulseSource& surfaces, size_t count, const OnPulse& on_pulse);

/// The pulses `first` to `last` - 1, which have a surface and of which one segment is tracked.
struct SegmentRange {
  size_t first = 0, last = 0;
  size_t limit = 0;  ///< end of the interval: the segment may share a pulse before it

  // clang-tidy 14 reads the 0 that the compiler compares with as a null pointer.
  // NOLINTNEXTLINE(modernize-use-nullptr)
  friend auto operator<=>(const SegmentRange&, const SegmentRange&) = default;
};

/// Intervals of pulses that no segment crosses.
struct TakeIntervals {
  std::vector<SegmentRange> tracked;       ///< ascending
  std::vector<UntrackedPulses> untracked;  ///< ascending
};

/// Pulses without a surface separate intervals, and so do gaps of ten or more lost pulses.
TakeIntervals intervals_of(const TakeSurvey& survey);

/// The pulses `from` to `to` - 1 that a segment covers, without one that it shares with the next.
struct SegmentExtent {
  size_t from = 0, to = 0;
};

/// What the segment of a range leaves uncovered: none, one or two ranges, ascending. The segments
/// of these depend on their own range alone, so they can be tracked at the same time.
std::vector<SegmentRange> rest_of(const SegmentRange& range, const SegmentExtent& extent);

/// The segments that were tracked so far.
using TrackedExtents = std::map<SegmentRange, SegmentExtent>;

/// The ranges of a take with and without a tracked segment. Both ascend.
struct SegmentPlan {
  std::vector<SegmentRange> tracked;  ///< ascending by their segments
  std::vector<SegmentRange> open;     ///< known ranges without a segment
};
SegmentPlan plan_of(const std::vector<SegmentRange>& intervals, const TrackedExtents& tracked);

/// Chooses key pulses. The choice depends on the survey and the images of the take alone, not on
/// earlier calls. One caller at a time; works in the caller's TBB arena.
class KeyChooser {
 public:
  /// `survey`, `pulses` (TakeSource::pulses) and `on_pulse` are borrowed.
  KeyChooser(const TakeSurvey& survey, const PulseSource& pulses, const OnPulse& on_pulse);

  /// The pulse with the highest score of a range, the first one of several. Images are read only of
  /// pulses whose upper bound is the highest, and of all pulses where one of these has no images:
  /// it counts as seen as little as any pulse with images.
  size_t best_key(const SegmentRange& range);

 private:
  const KeyQuality& examined(size_t pulse);

  const TakeSurvey& survey_;
  const PulseSource& pulses_;
  const OnPulse& on_pulse_;
  std::vector<std::optional<KeyQuality>> examined_;  ///< of pulses whose images were read
};

}  // namespace v3d::recon
