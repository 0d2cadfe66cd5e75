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
#include "recon/silhouettes/leave_one_out_hull.h"

namespace v3d {

struct CameraDisplacement {
  std::string camera;
  int64_t outline_px = 0;  ///< outline pixels that were compared
  /// How far, in pixels, the camera's silhouettes lie from where its calibration has them: to the
  /// right and down.
  Eigen::Vector2d shift{0, 0};
  /// It was moved, or its lens was, since the calibration. One camera at most is named.
  bool displaced = false;
};

/// How many pixels of an image count as one here: 1 to 1,535 pixels a side, 4 at 4096x3072. The
/// hull of the others is off by parts of the body and of voxels, which are so many times as many
/// pixels.
int displacement_scale(ImageSize size);

/// Cameras in their place come to no more than 1.3 pixels (100 simulated rigs of 15 XGA cameras, 6
/// pulses each: v3d-silhouette-faults), because the hull of the others is wider than the body, and
/// more so on one side. Times displacement_scale().
inline constexpr double kDisplacedPx = 1.5;
/// Fewer outline pixels prove nothing.
inline constexpr int64_t kMinOutlinePx = 200;
/// A shift of more is not found. Times displacement_scale().
inline constexpr int kMaxDisplacementPx = 16;

/// "knocked since it was calibrated: its silhouettes lie 3.1 pixels aside (+3.0 right, -0.8 down)".
std::string text_of(const CameraDisplacement& camera);

/// A pixel of the outline of the hull of the others: the direction out of the hull, and how far out
/// of it the camera's own outline lies, pixels by displacement_scale().
struct OutlineOffset {
  float nx = 0;
  float ny = 0;
  float distance = 0;
};

/// Wherever the outline of `hull` has a slope that can be told and `own` has an outline within
/// kMaxDisplacementPx of it; in rows and columns that are multiples of `step`, times
/// displacement_scale(). Pure.
std::vector<OutlineOffset> outline_offsets(const Mask& hull, const Mask& own, int step);

/// Looks at the last pulses that it was shown. One caller at a time; works in the caller's TBB
/// arena; the result depends on nothing but the arguments.
class DisplacementMeter {
 public:
  static constexpr size_t kPulses = 50;  ///< that are remembered

  explicit DisplacementMeter(const Rig& rig);

  /// One pulse. masks: one per camera of the rig, empty outside the view of the bounds, null where
  /// a camera takes no part; hulls: LeaveOneOutHull::silhouettes_of_each() of them. Pulses some
  /// tenths of a second apart tell most.
  void add(std::span<const Mask* const> masks, std::span<const Mask> hulls);

  int64_t pulses() const { return std::ssize(pulses_); }

  /// By camera of the rig. A camera aside cuts the hull that the others are held against, and can
  /// put another as far aside as itself. So those that lie farthest aside are measured again, in
  /// some of the pulses, with one of them after the other left out of the hulls: the camera that
  /// was knocked is the one without which the others are in their places. `hulls`: as those that
  /// add() was given were made by.
  std::vector<CameraDisplacement> result(LeaveOneOutHull& hulls) const;

 private:
  using Offsets = std::vector<OutlineOffset>;
  struct Pulse {
    std::vector<Offsets> offsets;            ///< by camera
    std::vector<std::vector<uint8_t>> runs;  ///< of the masks, by camera; empty: none
  };

  std::vector<CameraDisplacement> shifts() const;
  std::vector<Mask> masks_of(const Pulse& pulse) const;
  size_t culprit(std::span<const size_t> suspects, LeaveOneOutHull& hulls) const;
  double farthest_without(size_t left_out, std::span<const size_t> cameras,
                          LeaveOneOutHull& hulls) const;

  std::vector<std::string> names_;
  std::vector<ImageSize> sizes_;
  std::deque<Pulse> pulses_;
};

}  // namespace v3d
