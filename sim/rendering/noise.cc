#include "sim/rendering/noise.h"

#include <cmath>

namespace v3d::sim {
namespace {

/// Lattice spacing of the noise.
constexpr float kSpacingPx = 16;
/// Standard deviation of value_noise() in a plane of integer z.
constexpr double kNoiseStddev = 0.2146;

}  // namespace

Mask with_outline_noise(const Mask& mask, double sigma_px, uint64_t seed) {
  const auto scale = static_cast<float>(sigma_px / kNoiseStddev);
  const auto noise = static_cast<uint32_t>(mix(seed));
  const ImageSize size = mask.size();
  Mask result(size);
  for (int y = 0; y < size.height; ++y) {
    for (int x = 0; x < size.width; ++x) {
      const auto shifted = [&](int at, float axis) {
        const Eigen::Vector3f place(static_cast<float>(x) / kSpacingPx,
                                    static_cast<float>(y) / kSpacingPx, axis);
        const float shift = scale * (value_noise(place, noise) - 0.5F);
        return at + static_cast<int>(std::lround(shift));
      };
      const int from_x = shifted(x, 0), from_y = shifted(y, 1);
      const bool inside = from_x >= 0 && from_y >= 0 && from_x < size.width && from_y < size.height;
      if (inside && mask.get(from_x, from_y)) result.set(x, y);
    }
  }
  return result;
}

SensorColour sensor_colour(std::string_view camera, double spread, uint64_t seed) {
  uint64_t key = mix(seed ^ 0xC0104);
  for (const char c : camera) key = mix(key ^ static_cast<uint64_t>(c));
  uint64_t number = 0;
  const auto within = [&](double low, double high) {
    return static_cast<float>(spread * uniform(key, number++, low, high));
  };
  SensorColour sensor;
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) {
      sensor.matrix(i, j) += i == j ? within(-0.15, 0.15) : within(-0.05, 0.05);
    }
    sensor.black[i] = within(0, 6.0 / 255);
  }
  return sensor;
}

}  // namespace v3d::sim
