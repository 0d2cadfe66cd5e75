#include "calib/rig/rig_comparison.h"

#include <Eigen/Dense>
#include <algorithm>

#include "base/statistics.h"

namespace v3d::calib {
namespace {

using Eigen::Vector3d;

/// Where a camera stood then, and stands now.
struct Moved {
  std::string name;
  Vector3d then;
  Vector3d now;
};

std::vector<Moved> common_cameras(const Rig& now, const Rig& before) {
  std::vector<Moved> common;
  for (const RigCamera& camera : now) {
    const int then = find_camera(before, camera.name);
    if (then < 0) continue;
    common.push_back(
        {camera.name, before[static_cast<size_t>(then)].model.center(), camera.model.center()});
  }
  return common;
}

double size_of(const std::vector<Moved>& cameras) {
  Vector3d low = cameras.front().then, high = low;
  for (const Moved& camera : cameras) {
    low = low.cwiseMin(camera.then);
    high = high.cwiseMax(camera.then);
  }
  return (high - low).norm();
}

/// Sum of distances between pairs is free of any world; a swap keeps the set of places, so the
/// scale is told by the places sorted, not by name.
double scale_of(const std::vector<Moved>& cameras) {
  std::vector<double> then, now;
  for (size_t i = 0; i < cameras.size(); ++i) {
    for (size_t j = 0; j < i; ++j) {
      then.push_back((cameras[i].then - cameras[j].then).norm());
      now.push_back((cameras[i].now - cameras[j].now).norm());
    }
  }
  std::sort(then.begin(), then.end());
  std::sort(now.begin(), now.end());
  std::vector<double> ratios;
  for (size_t i = 0; i < then.size(); ++i) {
    if (then[i] > 0) ratios.push_back(now[i] / then[i]);
  }
  return ratios.empty() ? 1 : upper_median(ratios);
}

/// How far the places now are from those of then, after the best fit, when the cameras i and j
/// have changed names.
double misfit(const std::vector<Moved>& cameras, size_t i, size_t j) {
  std::vector<Vector3d> from, to;
  for (const Moved& camera : cameras) {
    from.push_back(camera.now);
    to.push_back(camera.then);
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

Rig moved_rig(const Rig& rig, const Similarity& new_from_old) {
  Rig moved;
  const RigidTransform old_from_new = new_from_old.rigid.inverse();
  for (const RigCamera& camera : rig) {
    const CameraModel& m = camera.model;
    RigidTransform scaled = m.cam_from_world();
    scaled.translation *= new_from_old.scale;
    RigCamera other = camera;
    other.model = CameraModel(m.size(), m.matrix(), m.distortion(), scaled * old_from_new);
    moved.push_back(std::move(other));
  }
  return moved;
}

LayoutChange compare_layouts(const Rig& now, const Rig& before) {
  LayoutChange change;
  const std::vector<Moved> cameras = common_cameras(now, before);
  if (cameras.size() < 2 || !(size_of(cameras) > 1e-6)) return change;
  change.scale = scale_of(cameras);
  if (cameras.size() < 4) return change;
  constexpr double kSamePlace = 0.05;  // of the rig's size
  const double same = kSamePlace * size_of(cameras);
  if (misfit(cameras, 0, 0) < same) return change;
  for (size_t i = 0; i < cameras.size(); ++i) {
    for (size_t j = 0; j < i; ++j) {
      if (misfit(cameras, i, j) < same)
        change.swapped.emplace_back(cameras[j].name, cameras[i].name);
    }
  }
  return change;
}

}  // namespace v3d::calib
