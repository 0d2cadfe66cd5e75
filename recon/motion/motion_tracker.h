// Tracking of a whole take: key pulses, and the segments around them.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "codec/motion_codec.h"
#include "recon/motion/segment_tracker.h"

namespace v3d::recon {

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

/// Pulses without a tracked surface.
struct UntrackedPulses {
  size_t first = 0, last = 0;  ///< indices of the take's pulses
  std::string reason;
};

struct TrackedMotion {
  /// By ascending pulses. Two segments share a pulse only as TrackedSegment::shares_last says.
  std::vector<TrackedSegment> segments;
  std::vector<UntrackedPulses> untracked;  ///< ascending
};

/// Called before work on a pulse of a take: its index. May throw to end the tracking.
using OnPulse = std::function<void(size_t index)>;

/// The pulses of a take, as the tracker reads them.
struct TakeSource {
  PulseSource pulses;
  /// The same pulses without images, for the choice of key pulses. Each has at least the cameras
  /// of `pulses`, with silhouettes that cover at least theirs, such as the whole image. So
  /// KeyQuality::score() is not below that of `pulses`.
  PulseSource surfaces;
  SurfaceColours colours{};  ///< null: the tracked surfaces get no colours
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
