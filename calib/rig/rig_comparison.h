// A rig held against what it was before: cameras that are swapped, a board of another size.
#pragma once

#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "base/camera_model.h"

namespace v3d::calib {

/// Cameras of both rigs, by name.
struct LayoutChange {
  /// All distances between cameras, now by then (median); 1 where nothing can be told.
  double scale = 1;
  /// Each stands where the other stood.
  std::vector<std::pair<std::string, std::string>> swapped;
};

/// Cameras that stood all in one place then (lenses alone) tell nothing. The two worlds need not
/// be the same.
LayoutChange compare_layouts(const Rig& now, const Rig& before);

/// The similarity that brings `from` onto `to` best (Umeyama 1991): to = scale * rotation * from +
/// translation. Requires three or more points that are not on a line.
struct Similarity {
  double scale = 1;
  RigidTransform rigid;
  Eigen::Vector3d operator*(const Eigen::Vector3d& p) const { return rigid * (scale * p); }
};
Similarity align_points(const std::vector<Eigen::Vector3d>& from,
                        const std::vector<Eigen::Vector3d>& to, bool with_scale);

/// The rig in a world in which new = moved * old, lengths times scale.
Rig moved_rig(const Rig& rig, const Similarity& new_from_old);

}  // namespace v3d::calib
