#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "sim/rendering/camera_images.h"
#include "sim/rendering/noise.h"

namespace v3d::sim {
namespace {

using Eigen::Vector3d;
using Eigen::Vector3f;

constexpr double kWallRadius = 3.25;
constexpr double kCeiling = 2.75;

float saw(double x) { return static_cast<float>(std::abs(x - std::floor(x) - 0.5)); }

float grain(const Vector3d& p, float cells_per_metre, uint32_t seed) {
  const Vector3f q = cells_per_metre * p.cast<float>();
  return 0.6F * value_noise(q, seed) + 0.4F * value_noise(3.3F * q, seed + 1);
}

/// Tiles of 0.5 m in two shades of green, with grout.
Vector3f floor_colour(const Vector3d& p, uint32_t seed) {
  const double x = p.x() / 0.5;
  const double y = p.y() / 0.5;
  const bool odd = (static_cast<int>(std::floor(x)) + static_cast<int>(std::floor(y))) % 2 != 0;
  const Vector3f tile = odd ? Vector3f(0.30F, 0.43F, 0.34F) : Vector3f(0.36F, 0.50F, 0.40F);
  if (std::max(saw(x), saw(y)) > 0.488F) {
    return {0.22F, 0.30F, 0.25F};
  }
  return tile * (0.85F + 0.3F * grain(p, 28, seed));
}

/// Acoustic panels of 0.6 x 0.9 m with holes in rows, on a green wall.
Vector3f wall_colour(const Vector3d& p, uint32_t seed) {
  const double along = std::atan2(p.y(), p.x()) * kWallRadius / 0.6;
  const double up = p.z() / 0.9;
  if (std::max(saw(along), saw(up)) > 0.485F) {
    return {0.18F, 0.27F, 0.22F};
  }
  const double hole = std::hypot(saw(along * 12) - 0.5, saw(up * 18) - 0.5);
  const uint32_t panel = static_cast<uint32_t>(
      mix(seed + static_cast<uint64_t>(std::floor(along) * 64 + std::floor(up) + 4096)));
  const float tone = 0.90F + 0.2F * static_cast<float>(unit(mix(panel)));
  const float lit = static_cast<float>(0.82 + 0.10 * p.z());
  const float dark = hole < 0.2 ? 0.75F : 1.0F;
  return Vector3f(0.33F, 0.50F, 0.40F) * (tone * lit * dark * (0.88F + 0.24F * grain(p, 35, seed)));
}

/// Fluorescent tubes behind green diffusers; a bare tube would be as white as the jacket.
Vector3f ceiling_colour(const Vector3d& p, uint32_t seed) {
  const bool tube = saw(p.x() / 0.9) < 0.05F && saw(p.y() / 1.5) < 0.42F;
  return tube ? Vector3f(0.52F, 0.80F, 0.64F)
              : Vector3f(0.18F, 0.31F, 0.24F) * (0.9F + 0.2F * grain(p, 20, seed));
}

}  // namespace

Vector3f room_colour(const Vector3d& eye, const Vector3d& direction, uint64_t seed) {
  const auto s = static_cast<uint32_t>(mix(seed ^ 0x4003));
  // The wall is a vertical cylinder around the eye.
  const double a = direction.head<2>().squaredNorm();
  const double b = eye.head<2>().dot(direction.head<2>());
  const double c = eye.head<2>().squaredNorm() - kWallRadius * kWallRadius;
  const double wall = a > 0 ? (-b + std::sqrt(std::max(0.0, b * b - a * c))) / a
                            : std::numeric_limits<double>::infinity();
  const double level = direction.z() < 0 ? 0 : kCeiling;
  const double flat = direction.z() == 0 ? std::numeric_limits<double>::infinity()
                                         : (level - eye.z()) / direction.z();
  if (wall < flat) {
    return wall_colour(eye + wall * direction, s);
  }
  const Vector3d p = eye + flat * direction;
  return direction.z() < 0 ? floor_colour(p, s) : ceiling_colour(p, s);
}

std::vector<Vector3f> room_image(const CameraModel& camera, uint64_t seed) {
  // Rays on a coarse lattice with bilinear interpolation; lens distortion is smooth enough.
  constexpr int kStep = 8;
  const ImageSize size = camera.size();
  const int columns = size.width / kStep + 2;
  const int rows = size.height / kStep + 2;
  std::vector<Vector3d> rays(static_cast<size_t>(columns) * rows);
  for (int j = 0; j < rows; ++j) {
    for (int i = 0; i < columns; ++i) {
      // Where the lens model has no ray, use the viewing direction.
      rays[static_cast<size_t>(j) * columns + i] =
          camera.ray({i * kStep, j * kStep}).value_or(camera.viewing_direction());
    }
  }
  const Vector3d eye = camera.center();
  std::vector<Vector3f> image(static_cast<size_t>(size.pixels()));
  for (int y = 0; y < size.height; ++y) {
    for (int x = 0; x < size.width; ++x) {
      const Vector3d* cell = &rays[static_cast<size_t>(y / kStep) * columns + x / kStep];
      const double fx = static_cast<double>(x % kStep) / kStep;
      const double fy = static_cast<double>(y % kStep) / kStep;
      const Vector3d ray = (1 - fy) * ((1 - fx) * cell[0] + fx * cell[1]) +
                           fy * ((1 - fx) * cell[columns] + fx * cell[columns + 1]);
      image[static_cast<size_t>(y) * size.width + x] = room_colour(eye, ray, seed);
    }
  }
  return image;
}

}  // namespace v3d::sim
