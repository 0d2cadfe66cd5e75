// Noise and sensor differences.
#pragma once

#include <Eigen/Core>
#include <cmath>
#include <cstdint>
#include <string_view>

#include "base/image/mask.h"

namespace v3d::sim {

// Stateless random numbers by hashing. Equal arguments give equal values on every machine and
// thread.

/// SplitMix64's finaliser: a bijection of 64-bit numbers in which each output bit depends on all
/// input bits.
constexpr uint64_t mix(uint64_t x) {
  x += 0x9E3779B97F4A7C15U;
  x = (x ^ (x >> 30)) * 0xBF58476D1CE4E5B9U;
  x = (x ^ (x >> 27)) * 0x94D049BB133111EBU;
  return x ^ (x >> 31);
}

/// Uniform in [0, 1).
constexpr double unit(uint64_t hash) { return static_cast<double>(hash >> 11) * 0x1.0p-53; }

/// Uniform in [low, high), for a seed and an index.
constexpr double uniform(uint64_t seed, uint64_t index, double low, double high) {
  return low + (high - low) * unit(mix(mix(seed) ^ index));
}

/// The random value of a lattice point, in [0, 1).
inline float lattice(int x, int y, int z, uint32_t seed) {
  uint32_t h = static_cast<uint32_t>(x) * 0x8DA6B343U ^ static_cast<uint32_t>(y) * 0xD8163841U ^
               static_cast<uint32_t>(z) * 0xCB1AB31FU ^ seed;
  h = (h ^ (h >> 15)) * 0x2C1B3C6DU;
  h = (h ^ (h >> 12)) * 0x297A2D39U;
  return static_cast<float>((h ^ (h >> 15)) >> 8) * 0x1.0p-24F;
}

/// Smooth 3D value noise with a lattice of one unit, in [0, 1).
inline float value_noise(const Eigen::Vector3f& p, uint32_t seed) {
  const Eigen::Vector3f base = p.array().floor();
  const Eigen::Vector3f f = p - base;
  const Eigen::Vector3f s = f.array() * f.array() * (3.0F - 2.0F * f.array());
  const int x = static_cast<int>(base.x());
  const int y = static_cast<int>(base.y());
  const int z = static_cast<int>(base.z());
  const auto along_x = [&](int dy, int dz) {
    const float a = lattice(x, y + dy, z + dz, seed);
    return a + s.x() * (lattice(x + 1, y + dy, z + dz, seed) - a);
  };
  const float near = along_x(0, 0) + s.y() * (along_x(1, 0) - along_x(0, 0));
  const float far = along_x(0, 1) + s.y() * (along_x(1, 1) - along_x(0, 1));
  return near + s.z() * (far - near);
}

// Silhouettes with noisy outlines, as an inaccurate segmentation gives them.

/// Displaces the outline by smooth noise with the standard deviation `sigma_px` along x and y.
/// Points more than 16 px apart are displaced independently. Deterministic for each `seed`.
Mask with_outline_noise(const Mask& mask, double sigma_px, uint64_t seed);

// Simulated differences between the colour responses of cameras.

/// The response of a sensor to light (0 to 1): black + matrix * light.
struct SensorColour {
  Eigen::Matrix3f matrix = Eigen::Matrix3f::Identity();
  Eigen::Vector3f black = Eigen::Vector3f::Zero();
};

/// A random response for a camera name. `spread` 0: all cameras are equal. `spread` 1: gains within
/// 15 %, cross-talk up to 5 % between two channels, black levels up to 6 grey values.
/// Deterministic.
SensorColour sensor_colour(std::string_view camera, double spread, uint64_t seed);

}  // namespace v3d::sim
