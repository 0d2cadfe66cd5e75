#include "plan/candidates.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "plan/action_samples.h"

namespace v3d::plan {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr int kMaxAround = 64;  // positions around the space at each height
constexpr int kMaxRows = 16;    // and along each side of the ceiling

int steps(double length, double step, int most) {
  return std::clamp(static_cast<int>(std::lround(length / step)), 1, most);
}

/// The point of a rectangle with these half sides at `share` (0 to 1) of its outline.
Vector2d on_rectangle(const Vector2d& half, double share) {
  const double sides[4] = {2 * half.x(), 2 * half.y(), 2 * half.x(), 2 * half.y()};
  const Vector2d corners[4] = {
      {-half.x(), -half.y()}, {half.x(), -half.y()}, {half.x(), half.y()}, {-half.x(), half.y()}};
  double along = share * 4 * half.sum();
  int side = 0;
  while (side < 3 && along > sides[side]) along -= sides[side++];
  const Vector2d& from = corners[side];
  return from + along / sides[side] * (corners[(side + 1) % 4] - from);
}

Vector2d on_ellipse(const Vector2d& half, double share) {
  const double angle = 2 * std::numbers::pi * share;
  return {half.x() * std::cos(angle), half.y() * std::sin(angle)};
}

struct Surroundings {
  Vector2d center, half;
  double low, high;  // z, world
  double step;
};

void add_around(const Surroundings& room, Mount mount, std::vector<Vector3d>& positions) {
  const int around = std::max(4, steps(4 * room.half.sum(), room.step, kMaxAround));
  const int rows = std::min(5, steps(room.high - room.low, room.step, kMaxRows) + 1);
  for (int row = 0; row < rows; ++row) {
    const double z = rows == 1 ? room.high : room.low + (room.high - room.low) * row / (rows - 1);
    for (int i = 0; i < around; ++i) {
      const double share = (i + 0.5 * (row % 2)) / around;
      const Vector2d at =
          mount == Mount::kRail ? on_ellipse(room.half, share) : on_rectangle(room.half, share);
      const Vector2d position = room.center + at;
      positions.emplace_back(position.x(), position.y(), z);
    }
  }
}

void add_ceiling(const Surroundings& room, std::vector<Vector3d>& positions) {
  const int columns = steps(2 * room.half.x(), room.step, kMaxRows);
  const int rows = steps(2 * room.half.y(), room.step, kMaxRows);
  for (int j = 0; j < rows; ++j) {
    for (int i = 0; i < columns; ++i) {
      positions.emplace_back(room.center.x() + room.half.x() * ((2 * i + 1.0) / columns - 1),
                             room.center.y() + room.half.y() * ((2 * j + 1.0) / rows - 1),
                             room.high);
    }
  }
}

}  // namespace

std::vector<Vector3d> candidate_positions(const Box& space, const MountOptions& options) {
  const double floor = floor_of(space);
  const Vector2d half = 0.5 * space.size().head<2>() + Vector2d::Constant(options.margin_m);
  const Surroundings room{space.center().head<2>(), half, floor + options.low_m,
                          floor + options.high_m, options.step_m};
  std::vector<Vector3d> positions;
  for (const Mount mount : options.mounts) {
    if (mount == Mount::kCeiling) {
      add_ceiling(room, positions);
    } else {
      add_around(room, mount, positions);
    }
  }
  std::erase_if(positions, [&](const Vector3d& p) { return space.contains(p); });
  return positions;
}

std::vector<Vector3d> candidate_targets(const Box& space) {
  const Vector2d center = space.center().head<2>();
  const Vector2d away = 0.25 * space.size().head<2>();
  std::vector<Vector3d> targets;
  for (const double height : {0.5, 0.9, 1.35}) {
    for (const Vector2d& side :
         {Vector2d(0, 0), Vector2d(1, 0), Vector2d(-1, 0), Vector2d(0, 1), Vector2d(0, -1)}) {
      const Vector2d at = center + side.cwiseProduct(away);
      targets.emplace_back(at.x(), at.y(), floor_of(space) + height);
    }
  }
  return targets;
}

CameraModel ideal_camera(const LensOptions& options, double focal_mm, const Vector3d& eye,
                         const Vector3d& target) {
  Eigen::Matrix3d k = Eigen::Matrix3d::Identity();
  k(0, 0) = k(1, 1) = focal_mm / options.sensor_width_mm * options.size.width;
  k(0, 2) = 0.5 * (options.size.width - 1);
  k(1, 2) = 0.5 * (options.size.height - 1);
  return {options.size, k, {}, look_at(eye, target)};
}

}  // namespace v3d::plan
