// Refinement of camera poses from the silhouettes of a take, without a board.
#pragma once

#include <vector>

#include "base/geometry/camera_model.h"
#include "base/image/mask.h"

namespace v3d::calib {

/// The silhouettes of all cameras at one instant; null where a camera has none.
using SilhouetteSet = std::vector<const Mask*>;

struct RefineOptions {
  bool focal_lengths = false;  ///< also refine the focal lengths
  /// Standard deviation of the calibration error, pixels. It is the prior of all parameters.
  double expected_px = 3;
  int threads = 2;
};

/// Epipolar tangency errors of one camera, over the held-out instants.
struct RefinedCamera {
  int tangents = 0;  ///< number of compared epipolar tangents
  /// Median distance between the tangent planes of this and another camera, pixels. After the
  /// refinement, a tangent that no longer exists counts as 1000 pixels.
  double before_px = 0;
  double after_px = 0;
  double moved_px = 0;  ///< image shift of the scene centre
};

struct RefineResult {
  Rig rig;  ///< the refined rig where `better`, else the given one
  bool better = false;
  double before_px = 0;  ///< median over all cameras
  double after_px = 0;
  std::vector<RefinedCamera> cameras;
};

inline constexpr int kMinSilhouetteSets = 6;

/// Refines the poses of calibrated cameras by epipolar tangents (rig/epipolar_tangents.h).
///
/// `sets`: instants with different poses of the performer. Every third instant is held out. The rig
/// is changed only where its median error on them falls below 0.6 of the error before. Silhouettes
/// at an image border are used as far as their tangents lie inside. Position, orientation and scale
/// of the whole rig are kept, because silhouettes do not determine them.
/// Throws InputError for fewer than kMinSilhouetteSets instants, and for too few tangents.
/// Pure. Uses options.threads threads.
RefineResult refine_by_silhouettes(const Rig& rig, const std::vector<SilhouetteSet>& sets,
                                   const RefineOptions& options);

}  // namespace v3d::calib
