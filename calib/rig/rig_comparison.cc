#include "calib/rig/rig_comparison.h"

#include <Eigen/Dense>
#include <algorithm>

#include "base/core/statistics.h"

namespace v3d::calib {
namespace {

using Eigen::Vector3d;

/// The positions of one camera in both calibrations.
struct MatchedCamera {
  std::string name;
  Vector3d previous;
  Vector3d now;
};

std::vector<MatchedCamera> match_cameras(const Rig& now, const Rig& previous_rig) {
  std::vector<MatchedCamera> matched;
  for (const RigCamera& camera : now) {
    const int previous = find_camera(previous_rig, camera.name);
    if (previous < 0) continue;
    matched.push_back({camera.name, previous_rig[static_cast<size_t>(previous)].model.center(),
                       camera.model.center()});
  }
  return matched;
}

double extent_of(const std::vector<MatchedCamera>& cameras) {
  Vector3d low = cameras.front().previous, high = low;
  for (const MatchedCamera& camera : cameras) {
    low = low.cwiseMin(camera.previous);
    high = high.cwiseMax(camera.previous);
  }
  return (high - low).norm();
}

/// Compares sorted distances between cameras. They do not depend on the world frame, nor on the
/// names, so swapped cameras do not change the scale.
double scale_of(const std::vector<MatchedCamera>& cameras) {
  std::vector<double> previous, now;
  for (size_t i = 0; i < cameras.size(); ++i) {
    for (size_t j = 0; j < i; ++j) {
      previous.push_back((cameras[i].previous - cameras[j].previous).norm());
      now.push_back((cameras[i].now - cameras[j].now).norm());
    }
  }
  std::sort(previous.begin(), previous.end());
  std::sort(now.begin(), now.end());
  std::vector<double> ratios;
  for (size_t i = 0; i < previous.size(); ++i) {
    if (previous[i] > 0) ratios.push_back(now[i] / previous[i]);
  }
  return ratios.empty() ? 1 : upper_median(ratios);
}

/// The largest distance between the positions now and before, after the best fit, with the names
/// of cameras i and j exchanged.
double max_distance(const std::vector<MatchedCamera>& cameras, size_t i, size_t j) {
  std::vector<Vector3d> from, to;
  for (const MatchedCamera& camera : cameras) {
    from.push_back(camera.now);
    to.push_back(camera.previous);
  }
  std::swap(from[i], from[j]);
  const Similarity fit = align_points(from, to, true);
  double worst = 0;
  for (size_t k = 0; k < from.size(); ++k) worst = std::max(worst, (fit * from[k] - to[k]).norm());
  return worst;
}

}  // namespace

Similarity align_points(const std::vector<Vector3d>& from, const std::vector<Vector3d>& to,
                        bool with_scale) {
  Eigen::Matrix3Xd a(3, from.size()), b(3, to.size());
  for (size_t i = 0; i < from.size(); ++i) {
    a.col(static_cast<long>(i)) = from[i];
    b.col(static_cast<long>(i)) = to[i];
  }
  const Eigen::Matrix4d m = Eigen::umeyama(a, b, with_scale);
  Similarity result;
  result.scale = with_scale ? m.block<3, 1>(0, 0).norm() : 1;
  result.rigid.rotation = m.topLeftCorner<3, 3>() / result.scale;
  result.rigid.translation = m.topRightCorner<3, 1>();
  return result;
}

Rig transformed_rig(const Rig& rig, const Similarity& new_from_old) {
  Rig transformed;
  const RigidTransform old_from_new = new_from_old.rigid.inverse();
  for (const RigCamera& camera : rig) {
    const CameraModel& m = camera.model;
    RigidTransform scaled = m.cam_from_world();
    scaled.translation *= new_from_old.scale;
    RigCamera other = camera;
    other.model = CameraModel(m.size(), m.matrix(), m.distortion(), scaled * old_from_new);
    transformed.push_back(std::move(other));
  }
  return transformed;
}

RigDifference compare_rigs(const Rig& now, const Rig& previous) {
  RigDifference difference;
  const std::vector<MatchedCamera> cameras = match_cameras(now, previous);
  if (cameras.size() < 2 || !(extent_of(cameras) > 1e-6)) return difference;
  difference.scale = scale_of(cameras);
  if (cameras.size() < 4) return difference;
  constexpr double kMaxDistance = 0.05;  // of the rig's size
  const double tolerance = kMaxDistance * extent_of(cameras);
  if (max_distance(cameras, 0, 0) < tolerance) return difference;
  for (size_t i = 0; i < cameras.size(); ++i) {
    for (size_t j = 0; j < i; ++j) {
      if (max_distance(cameras, i, j) < tolerance)
        difference.swapped.emplace_back(cameras[j].name, cameras[i].name);
    }
  }
  return difference;
}

}  // namespace v3d::calib
