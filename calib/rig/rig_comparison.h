// Comparison of a rig with its previous calibration, and similarity transforms of rigs.
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "base/geometry/camera_model.h"

namespace v3d::calib {

/// Differences between two calibrations of a rig; cameras correspond by name.
struct RigDifference {
  /// Median ratio of the distances between cameras, now to previous; 1 where it is unknown.
  double scale = 1;
  /// Pairs of cameras with exchanged positions.
  std::vector<std::pair<std::string, std::string>> swapped;
};

/// The two worlds may differ. Cameras that all have the same position in `previous` (calibrated
/// lenses only) give no difference.
RigDifference compare_rigs(const Rig& now, const Rig& previous);

/// x -> rigid * (scale * x).
struct Similarity {
  double scale = 1;
  RigidTransform rigid;
  Eigen::Vector3d operator*(const Eigen::Vector3d& p) const { return rigid * (scale * p); }
};

/// The least-squares similarity that maps `from` to `to`. Requires three or more points that are
/// not collinear. `with_scale` false: the scale is 1. Source: Umeyama 1991.
Similarity align_points(const std::vector<Eigen::Vector3d>& from,
                        const std::vector<Eigen::Vector3d>& to, bool with_scale);

/// The rig in the world frame `new`.
Rig transformed_rig(const Rig& rig, const Similarity& new_from_old);

}  // namespace v3d::calib
