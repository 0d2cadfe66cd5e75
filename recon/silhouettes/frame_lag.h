// Frame lag: cameras whose frames show another pulse than their number. silhouette_change() tests
// one pulse, SyncCheck the pulses of some seconds.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "base/geometry/camera_model.h"
#include "base/image/mask.h"

namespace v3d::recon {

/// What the leave-one-out hull of a camera lost and gained since the previous pulse, and how much
/// of both its silhouette shows; pixels.
struct SilhouetteChange {
  int64_t pixels = 0;  ///< of the image
  int64_t lost = 0;
  int64_t lost_shown = 0;
  int64_t gained = 0;
  int64_t gained_shown = 0;

  /// True when the silhouette shows what was lost and not what was gained: it is one pulse late. A
  /// camera in step shows nothing of what was lost and much of what was gained. False when too
  /// little moved.
  bool is_late() const;
  /// Shown part of the lost pixels minus shown part of the gained pixels, in standard deviations of
  /// independent pixels.
  double excess() const;
};

/// `expected` and `expected_before`: the silhouette of the leave-one-out hull in this camera at
/// this pulse and at the previous one. Requires equal sizes.
SilhouetteChange silhouette_change(const Mask& own, const Mask& expected,
                                   const Mask& expected_before);

/// Largest lag that is tested, pulses, in both directions.
inline constexpr int kMaxPulsesOff = 2;
inline constexpr int kShifts = 2 * kMaxPulsesOff + 1;

/// The masks of one camera at pulses p - 2 to p + 2; null where it has no frame.
using MaskWindow = std::array<const Mask*, kShifts>;

struct CameraSync {
  std::string camera;
  int64_t frames = 0;  ///< pulses that were compared
  /// By shift: pixels in which the camera's mask of pulse p + shift and the leave-one-out hull at p
  /// differ, summed over all p, as part of the pixels of its masks.
  std::array<double, kShifts> disagreement{};
  /// By shift: frames in which they differ less than at shift 0.
  std::array<int64_t, kShifts> better{};

  /// Pulses by which the camera is late: its image of pulse p shows pulse p minus this. Negative
  /// when early. 0 unless another pulse fits clearly better in most frames, and when nothing moved.
  int pulses_late() const;
};

/// Compares each camera with the leave-one-out hull at several pulses. One thread. Deterministic.
class SyncCheck {
 public:
  explicit SyncCheck(const Rig& rig);

  /// Adds one pulse. `windows` has one entry per camera of the rig, with masks cut to
  /// bounds_mask(); `hulls` is the result of LeaveOneOutHull::silhouettes_of_each(). A camera with
  /// a gap in its window is skipped.
  void add(std::span<const MaskWindow> windows, std::span<const Mask> hulls);

  /// By camera of the rig.
  std::vector<CameraSync> result() const;

 private:
  struct Sum {
    std::string camera;
    int64_t frames = 0;
    int64_t pixels = 0;
    std::array<int64_t, kShifts> differing{}, better{};
  };
  static void compare(Sum& sum, const MaskWindow& window, const Mask& hull);

  std::vector<Sum> sums_;
};

}  // namespace v3d::recon
