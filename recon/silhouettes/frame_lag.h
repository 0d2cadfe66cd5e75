// Silhouettes that show the pulse before: found by what changed from one pulse to the next.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "base/camera_model.h"
#include "base/mask.h"

namespace v3d {

/// What the hull of the others lost and won from the pulse before to this one, and how much of
/// either a camera's silhouette shows; pixels.
struct SilhouetteChange {
  int64_t pixels = 0;  ///< of the image
  int64_t lost = 0;
  int64_t lost_shown = 0;
  int64_t gained = 0;
  int64_t gained_shown = 0;

  /// The silhouette shows what is no longer there, and not what has come. A camera in step shows
  /// nothing of what was lost, for its silhouette lies inside the hull, and much of what was won;
  /// one that is a pulse late, the reverse. False where too little moved to tell.
  bool is_late() const;
  /// By how much the part that is shown of what was lost exceeds that of what was won, in standard
  /// deviations of independent pixels: to compare cameras.
  double excess() const;
};

/// `expected`, `expected_before`: the silhouette of the hull of the others in this camera, at this
/// pulse and at the one before. Requires equal sizes. Pure.
SilhouetteChange silhouette_change(const Mask& own, const Mask& expected,
                                   const Mask& expected_before);

/// Pulses before and after its own at which a camera is compared.
inline constexpr int kMaxPulsesOff = 2;
inline constexpr int kShifts = 2 * kMaxPulsesOff + 1;

/// What one camera saw at pulse p - 2, p - 1, p, p + 1, p + 2; null where it has no frame.
using MaskWindow = std::array<const Mask*, kShifts>;

struct CameraSync {
  std::string camera;
  int64_t frames = 0;  ///< pulses that were compared
  /// Pixels in which the camera's silhouette of label p - 2 ... p + 2 and the hull of the others at
  /// p differ, over all pulses, as part of its silhouettes' pixels.
  std::array<double, kShifts> disagreement{};
  /// Frames in which they differ less than those of label p do.
  std::array<int64_t, kShifts> better{};

  /// How many pulses the camera is late (its image of label p shows pulse p minus so many),
  /// negative where it is early; 0 unless another pulse fits clearly better, in most
  /// frames. What does not move looks the same at every pulse: then it is 0 too.
  int pulses_late() const;
};

/// Compares frame by frame. The result depends on nothing but the arguments.
class SyncCheck {
 public:
  explicit SyncCheck(const Rig& rig);

  /// One pulse: a window per camera of the rig, of masks of the camera's image size, empty outside
  /// the view of the bounds, and the hull of the others in every camera
  /// (LeaveOneOutHull::silhouettes_of_each()). A camera with a gap in its window is not compared.
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

}  // namespace v3d
