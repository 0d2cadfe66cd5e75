#include "sim/rendering/sensor_colour.h"

#include "sim/rendering/noise.h"

namespace v3d::sim {

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
