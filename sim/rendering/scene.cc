#include "sim/rendering/scene.h"

#include <fmt/core.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "base/core/error.h"
#include "sim/rendering/noise.h"

namespace v3d::sim {
namespace {

using Eigen::Vector3d;

constexpr double kStudioRadius = 3.0;
constexpr std::array kHeights = {1.25, 2.30, 0.55, 1.80};  // metres; the last one: close-ups

bool is_close_up(int index) { return index % 4 == 3; }

/// Mild distortion, as of a good wide-angle lens; random for each camera.
Distortion lens(uint64_t seed, bool close_up) {
  const double strength = close_up ? 0.5 : 1.0;
  Distortion d{};
  d[0] = strength * uniform(seed, 10, -0.11, -0.06);   // k1
  d[1] = strength * uniform(seed, 11, 0.015, 0.035);   // k2
  d[2] = uniform(seed, 12, -0.0006, 0.0006);           // p1
  d[3] = uniform(seed, 13, -0.0006, 0.0006);           // p2
  d[4] = strength * uniform(seed, 14, -0.004, 0.002);  // k3
  return d;
}

RigCamera make_camera(int index, int count, ImageSize size, uint64_t studio_seed) {
  const uint64_t seed = mix(studio_seed) + static_cast<uint64_t>(index);
  const bool close_up = is_close_up(index);
  const double angle = 2 * std::numbers::pi * (index + uniform(seed, 0, -0.15, 0.15)) / count;
  const double height =
      kHeights[static_cast<size_t>(index) % kHeights.size()] + uniform(seed, 1, -0.08, 0.08);
  const Vector3d eye(kStudioRadius * std::cos(angle), kStudioRadius * std::sin(angle), height);
  // Other cameras frame the whole body and a raised sword. Close-up cameras frame the head and the
  // arms, or the legs, in turn.
  const double aim = close_up ? ((index / 4) % 2 == 0 ? 1.45 : 0.75) : 1.08;
  const Vector3d target(uniform(seed, 2, -0.06, 0.06), uniform(seed, 3, -0.06, 0.06),
                        aim + uniform(seed, 4, -0.03, 0.03));
  // Focal lengths for 1024x768; other sizes have the same field of view in their shorter direction.
  const double scale = std::min(size.width / 1024.0, size.height / 768.0);
  const double focal =
      scale * (close_up ? uniform(seed, 5, 1050, 1250) : uniform(seed, 5, 640, 690));
  Eigen::Matrix3d k = Eigen::Matrix3d::Identity();
  k(0, 0) = focal;
  k(1, 1) = focal * uniform(seed, 6, 0.999, 1.001);
  k(0, 2) = 0.5 * (size.width - 1) + scale * uniform(seed, 7, -9, 9);
  k(1, 2) = 0.5 * (size.height - 1) + scale * uniform(seed, 8, -9, 9);
  const std::string name = fmt::format("cam{:02}", index + 1);
  return {name, CameraModel(size, k, lens(seed, close_up), look_at(eye, target))};
}

}  // namespace

Rig make_rig(int cameras, ImageSize size, uint64_t seed) {
  V3D_CHECK(cameras > 0 && size.width > 0 && size.height > 0);
  Rig rig;
  for (int i = 0; i < cameras; ++i) {
    rig.push_back(make_camera(i, cameras, size, seed));
  }
  return rig;
}

}  // namespace v3d::sim
