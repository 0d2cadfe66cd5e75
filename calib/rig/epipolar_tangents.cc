#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <optional>

#include "base/image/mask_operations.h"
#include "calib/rig/silhouette_refinement.h"

namespace v3d::calib {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

struct Point {
  Vector2d at;  ///< x/z, y/z
  bool at_border = false;
};

double cross(const Vector2d& o, const Vector2d& a, const Vector2d& b) {
  return (a - o).x() * (b - o).y() - (a - o).y() * (b - o).x();
}

/// Andrew's monotone chain.
std::vector<Point> convex_hull(std::vector<Point> points) {
  std::ranges::sort(points, [](const Point& a, const Point& b) {
    return std::pair(a.at.x(), a.at.y()) < std::pair(b.at.x(), b.at.y());
  });
  std::vector<Point> hull;
  const auto chain = [&hull](const Point& point, size_t fixed) {
    while (hull.size() >= fixed + 2 &&
           cross(hull[hull.size() - 2].at, hull.back().at, point.at) <= 0) {
      hull.pop_back();
    }
    hull.push_back(point);
  };
  for (const Point& point : points) chain(point, 0);
  const size_t lower = hull.size() - 1;
  for (auto point = points.rbegin() + 1; point < points.rend(); ++point) chain(*point, lower);
  hull.pop_back();
  return hull;
}

/// The first and the last foreground pixel of every row.
std::vector<Vector2d> row_ends(const Mask& mask) {
  std::vector<Vector2d> rays;
  std::vector<Run> runs;
  for (int y = 0; y < mask.size().height; ++y) {
    runs.clear();
    append_runs(mask.row(y), y, runs);
    if (runs.empty()) continue;
    rays.emplace_back(runs.front().begin, y);
    rays.emplace_back(runs.back().end - 1, y);
  }
  return rays;
}

bool is_at_border(const Vector2d& pixel, ImageSize size) {
  constexpr double kNear = 2;
  return pixel.minCoeff() < kNear || pixel.x() > size.width - 1 - kNear ||
         pixel.y() > size.height - 1 - kNear;
}

/// The point nearest to the rays through the middles of all silhouettes.
Vector3d scene_point_of(const std::vector<CameraModel>& cameras,
                        std::span<const Outline> outlines) {
  Eigen::Matrix3d a = Eigen::Matrix3d::Identity() * 1e-9;
  Vector3d b = Vector3d::Zero();
  for (size_t c = 0; c < cameras.size(); ++c) {
    if (outlines[c].empty()) continue;
    const Vector3d d =
        (cameras[c].cam_from_world().rotation.transpose() * outlines[c].middle).normalized();
    const Eigen::Matrix3d across = Eigen::Matrix3d::Identity() - d * d.transpose();
    a += across;
    b += across * cameras[c].center();
  }
  return a.ldlt().solve(b);
}

/// Indices of the rays that the outermost planes through the baseline touch; -1 where the baseline
/// passes through or near the silhouette.
struct TangentRays {
  int min_slope = -1, max_slope = -1;
};

TangentRays tangent_rays(const Outline& outline, const Eigen::Matrix3d& rotation, const Vector3d& u,
                         const Vector3d& v) {
  constexpr double kMaxSlope = 3;  // tangent of the angle to the middle
  TangentRays rays;
  double min_slope = 0, max_slope = 0;
  const Vector3d across = rotation * u, along = rotation * v;
  for (size_t i = 0; i < outline.rays.size(); ++i) {
    const double x = across.dot(outline.rays[i]), y = along.dot(outline.rays[i]);
    if (!(y > 0) || std::abs(x) > kMaxSlope * y) return {};
    const double slope = x / y;
    if (i == 0 || slope < min_slope) min_slope = slope, rays.min_slope = static_cast<int>(i);
    if (i == 0 || slope > max_slope) max_slope = slope, rays.max_slope = static_cast<int>(i);
  }
  return rays;
}

/// Rotation of the plane, radians, for an error of one pixel in its ray.
double radians_per_px(const CameraModel& camera, const Vector3d& ray, const Vector3d& axis) {
  const Vector3d d = camera.cam_from_world().rotation.transpose() * ray;
  const double off_axis = d.cross(axis).norm() / d.norm();
  // The angle of a pixel decreases with the distance from the image centre.
  return d.dot(camera.viewing_direction()) / d.norm() / (camera.matrix()(0, 0) * off_axis);
}

void add_pair(const std::vector<CameraModel>& cameras, std::span<const Outline> outlines,
              const Vector3d& scene_point, int a, int b, std::vector<EpipolarTangent>& tangents) {
  const CameraModel &ca = cameras[a], &cb = cameras[b];
  const Vector3d axis = (cb.center() - ca.center()).normalized();
  const Vector3d out = scene_point - ca.center();
  const Vector3d v = (out - axis * axis.dot(out)).normalized(), u = axis.cross(v);
  const TangentRays in_a = tangent_rays(outlines[a], ca.cam_from_world().rotation, u, v);
  const TangentRays in_b = tangent_rays(outlines[b], cb.cam_from_world().rotation, u, v);
  if (in_a.min_slope < 0 || in_b.min_slope < 0) return;
  const auto add = [&](int i, int j, double side) {
    if (outlines[a].at_border[i] || outlines[b].at_border[j]) return;
    const Vector3d &ray_a = outlines[a].rays[i], &ray_b = outlines[b].rays[j];
    tangents.push_back({a, b, ray_a, ray_b, scene_point, side * radians_per_px(ca, ray_a, axis),
                        side * radians_per_px(cb, ray_b, axis)});
  };
  add(in_a.min_slope, in_b.min_slope, -1);
  add(in_a.max_slope, in_b.max_slope, 1);
}

}  // namespace

Outline outline_of(const Mask& mask, const CameraModel& camera) {
  const Eigen::Matrix3d& k = camera.matrix();
  std::vector<Point> points;
  for (const Vector2d& pixel : row_ends(mask)) {
    const double y = (pixel.y() - k(1, 2)) / k(1, 1);
    const double x = (pixel.x() - k(0, 2) - k(0, 1) * y) / k(0, 0);
    const auto straight = camera.undistort({x, y});
    if (straight) points.push_back({*straight, is_at_border(pixel, mask.size())});
  }
  Outline outline;
  if (points.size() < 3) return outline;
  Vector2d sum = Vector2d::Zero();
  for (const Point& point : points) sum += point.at;
  outline.middle = (sum / static_cast<double>(points.size())).homogeneous();
  for (const Point& point : convex_hull(std::move(points))) {
    outline.rays.push_back(point.at.homogeneous());
    outline.at_border.push_back(point.at_border);
  }
  return outline;
}

double angle_between(const EpipolarTangent& tangent, const CameraModel& a, const CameraModel& b) {
  return angle_between<double>(tangent, a.cam_from_world().rotation, a.center(),
                               b.cam_from_world().rotation, b.center());
}

std::vector<EpipolarTangent> epipolar_tangents(const std::vector<CameraModel>& cameras,
                                               std::span<const Outline> outlines) {
  const Vector3d scene_point = scene_point_of(cameras, outlines);
  std::vector<EpipolarTangent> tangents;
  const int count = static_cast<int>(cameras.size());
  for (int b = 0; b < count; ++b) {
    for (int a = 0; a < b; ++a) {
      if (outlines[a].empty() || outlines[b].empty()) continue;
      add_pair(cameras, outlines, scene_point, a, b, tangents);
    }
  }
  return tangents;
}

}  // namespace v3d::calib
