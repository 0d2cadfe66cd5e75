// Displaced cameras: cameras that moved since the calibration. Their silhouettes are shifted
// against the leave-one-out hull, always in the same direction.
#pragma once

#include <Eigen/Core>
#include <deque>
#include <span>
#include <string>
#include <vector>

#include "base/geometry/camera_model.h"
#include "base/image/mask.h"
#include "recon/silhouettes/leave_one_out_hull.h"

namespace v3d::recon {

struct CameraDisplacement {
  std::string camera;
  int64_t outline_px = 0;  ///< outline pixels that were compared
  /// Shift of the camera's silhouettes against its calibration, pixels, to the right and down.
  Eigen::Vector2d shift{0, 0};
  /// The camera or its lens moved since the calibration. True for at most one camera.
  bool displaced = false;
};

/// Pixels of the image that count as one here: 1 up to 1,535 pixels a side, 4 at 4096 x 3072. The
/// errors of the leave-one-out hull grow with the resolution.
int displacement_scale(ImageSize size);

/// Shift from which on a camera counts as displaced, times displacement_scale(). Cameras in place
/// have at most 1.3 pixels, because the leave-one-out hull is wider than the body, and more so on
/// one side. (100 simulated rigs of 15 XGA cameras, 6 pulses each: v3d-silhouette-faults.)
inline constexpr double kDisplacedPx = 1.5;
/// Smallest number of outline pixels for a measurement.
inline constexpr int64_t kMinOutlinePx = 200;
/// Largest shift that is found, times displacement_scale().
inline constexpr int kMaxDisplacementPx = 16;

/// "displaced since its calibration: its silhouettes are shifted by 3.1 pixels (+3.0 right, -0.8
/// down)".
std::string text_of(const CameraDisplacement& camera);

/// One outline pixel of the leave-one-out hull: outward normal, and distance to the outline of the
/// camera, pixels divided by displacement_scale(), positive outwards.
struct OutlineOffset {
  float nx = 0;
  float ny = 0;
  float distance = 0;
};

/// Offsets where the outline of `hull` has a measurable slope and `own` has an outline within
/// kMaxDisplacementPx, in rows and columns that are multiples of `step`, times
/// displacement_scale().
std::vector<OutlineOffset> outline_offsets(const Mask& hull, const Mask& own, int step);

/// Measures over the last kPulses pulses. One caller at a time; works in the caller's TBB arena.
/// Deterministic.
class DisplacementMeter {
 public:
  static constexpr size_t kPulses = 50;  ///< pulses that are kept

  explicit DisplacementMeter(const Rig& rig);

  /// Adds one pulse. `masks` has one entry per camera of the rig, cut to bounds_mask(), null where
  /// a camera takes no part; `hulls` is LeaveOneOutHull::silhouettes_of_each() of them. Pulses some
  /// tenths of a second apart give the best measurement.
  void add(std::span<const Mask* const> masks, std::span<const Mask> hulls);

  int64_t pulses() const { return std::ssize(pulses_); }

  /// By camera of the rig. A displaced camera distorts the hulls of the others, which then seem
  /// displaced as well. So the cameras with the largest shifts are measured again in some of the
  /// pulses, and each is excluded from the hulls in turn. The displaced camera is the one without
  /// which the others agree. `hulls` has the parameters of those passed to add().
  std::vector<CameraDisplacement> result(LeaveOneOutHull& hulls) const;

 private:
  using Offsets = std::vector<OutlineOffset>;
  struct Pulse {
    std::vector<Offsets> offsets;            ///< by camera
    std::vector<std::vector<uint8_t>> runs;  ///< of the masks, by camera; empty: none
  };

  std::vector<CameraDisplacement> shifts() const;
  std::vector<Mask> masks_of(const Pulse& pulse) const;
  size_t find_displaced(std::span<const size_t> suspects, LeaveOneOutHull& hulls) const;
  double max_shift_without(size_t left_out, std::span<const size_t> cameras,
                           LeaveOneOutHull& hulls) const;

  std::vector<std::string> names_;
  std::vector<ImageSize> sizes_;
  std::deque<Pulse> pulses_;
};

}  // namespace v3d::recon
