// Cameras that were knocked, found in the images: a camera's silhouettes lie beside the hull of the
// others, always in the same direction.
#pragma once

#include <Eigen/Core>
#include <deque>
#include <span>
#include <string>
#include <vector>

#include "base/camera_model.h"
#include "base/mask.h"

namespace v3d {

struct CameraDrift {
  std::string camera;
  int64_t outline_px = 0;  ///< outline pixels that were compared
  /// How far, in pixels, the camera's silhouettes lie from where its calibration has them: to the
  /// right and down.
  Eigen::Vector2d shift{0, 0};
  /// It was moved, or its lens was, since the calibration. Only the camera that lies farthest aside
  /// is named: a hull that one camera cuts wrongly can put another aside by as much, in 2 of 24
  /// simulated studios by more (v3d-silhouette-faults).
  bool knocked = false;
};

/// Cameras in their place come to no more than 0.8 pixels (24 simulated rigs of 15 XGA cameras, 6
/// pulses each: v3d-silhouette-faults), because the hull of the others is wider than the body, and
/// more so on one side.
inline constexpr double kKnockedPx = 1.5;
/// Fewer outline pixels prove nothing.
inline constexpr int64_t kLeastOutlinePx = 200;
/// A shift of more is not found.
inline constexpr int kMostDriftPx = 16;

/// A pixel of the outline of the hull of the others: the direction out of the hull, and how far out
/// of it the camera's own outline lies, pixels.
struct OutlineOffset {
  float nx = 0;
  float ny = 0;
  float distance = 0;
};

/// Wherever the outline of `hull` has a slope that can be told and `own` has an outline within
/// kMostDriftPx of it; in rows and columns that are multiples of `step`. Pure.
std::vector<OutlineOffset> outline_offsets(const Mask& hull, const Mask& own, int step);

/// Looks at the last pulses that it was shown. One caller at a time; works in the caller's TBB
/// arena; the result depends on nothing but the arguments.
class DriftMeter {
 public:
  static constexpr size_t kPulses = 50;  ///< that are remembered

  explicit DriftMeter(const Rig& rig);

  /// One pulse. masks: one per camera of the rig, empty outside the view of the bounds, null where
  /// a camera takes no part; hulls: HullOfOthers::silhouettes_of_each() of them. Pulses some tenths
  /// of a second apart tell most.
  void add(std::span<const Mask* const> masks, std::span<const Mask> hulls);

  /// By camera of the rig.
  std::vector<CameraDrift> result() const;

 private:
  using Offsets = std::vector<OutlineOffset>;
  std::vector<std::string> names_;
  std::deque<std::vector<Offsets>> pulses_;  ///< by camera
};

}  // namespace v3d
