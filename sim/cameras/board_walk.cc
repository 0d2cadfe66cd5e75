#include "sim/cameras/board_walk.h"

#include <cmath>
#include <numbers>
#include <optional>

#include "sim/rendering/noise.h"

namespace v3d::sim {
namespace {

using Eigen::AngleAxisd;
using Eigen::Vector3d;

/// Standard normal noise along x and y. Source: Box, Muller 1958.
Eigen::Vector2d noise_at(uint64_t seed, uint64_t number) {
  const double radius = std::sqrt(-2 * std::log(1 - uniform(seed, 2 * number, 0, 1)));
  const double angle = uniform(seed, 2 * number + 1, 0, 2 * std::numbers::pi);
  return {radius * std::cos(angle), radius * std::sin(angle)};
}

Vector3d middle_of(std::span<const Vector3d> corners) {
  Vector3d sum = Vector3d::Zero();
  for (const Vector3d& c : corners) sum += c;
  return sum / static_cast<double>(corners.size());
}

/// Board pose `index`: upright, facing outwards, then tilted at random.
RigidTransform pose_of(int index, const Vector3d& middle, const BoardWalkOptions& options) {
  const uint64_t seed = mix(options.seed) + static_cast<uint64_t>(index);
  // Multiples of the golden angle cover all directions for any number of poses.
  const double heading = index * std::numbers::pi * (3 - std::sqrt(5.0));
  Eigen::Matrix3d facing;  // the board's z along the heading, its y up
  facing.col(2) = Vector3d(std::cos(heading), std::sin(heading), 0);
  facing.col(1) = Vector3d::UnitZ();
  facing.col(0) = facing.col(1).cross(facing.col(2));
  const Eigen::Matrix3d lean = (AngleAxisd(uniform(seed, 0, -0.6, 0.6), Vector3d::UnitX()) *
                                AngleAxisd(uniform(seed, 1, -0.6, 0.6), Vector3d::UnitY()) *
                                AngleAxisd(uniform(seed, 2, -0.8, 0.8), Vector3d::UnitZ()))
                                   .toRotationMatrix();
  const Vector3d place(uniform(seed, 3, -0.9, 0.9), uniform(seed, 4, -0.9, 0.9),
                       uniform(seed, 5, 0.5, 1.7));
  const Eigen::Matrix3d turn = facing * lean;
  return {turn, place - turn * middle};
}

std::optional<std::vector<Eigen::Vector2d>> observe(const CameraModel& camera,
                                                    const RigidTransform& world_from_board,
                                                    std::span<const Vector3d> corners) {
  const double kMinCosine = std::cos(65 * std::numbers::pi / 180);
  const Vector3d to_camera = (camera.center() - world_from_board * middle_of(corners)).normalized();
  if (to_camera.dot(world_from_board.rotation.col(2)) < kMinCosine) return std::nullopt;
  std::vector<Eigen::Vector2d> pixels;
  for (const Vector3d& corner : corners) {
    const auto pixel = camera.project(world_from_board * corner);
    if (!pixel || !camera.inside_image(*pixel)) return std::nullopt;
    pixels.push_back(*pixel);
  }
  return pixels;
}

}  // namespace

BoardWalk walk_board(const Rig& rig, std::span<const Vector3d> corners,
                     const BoardWalkOptions& options) {
  BoardWalk walk;
  const Vector3d middle = middle_of(corners);
  uint64_t number = 0;
  for (int board = 0; board < options.boards; ++board) {
    walk.world_from_board.push_back(pose_of(board, middle, options));
    for (size_t camera = 0; camera < rig.size(); ++camera) {
      const auto pixels = observe(rig[camera].model, walk.world_from_board.back(), corners);
      if (!pixels) continue;
      for (size_t i = 0; i < pixels->size(); ++i, ++number) {
        walk.corners.push_back({static_cast<int>(camera), board, static_cast<int>(i),
                                (*pixels)[i] + options.noise_px * noise_at(options.seed, number)});
      }
    }
  }
  return walk;
}

}  // namespace v3d::sim
