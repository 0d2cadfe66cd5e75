#include "sim/cameras/device_clock.h"

#include "sim/rendering/noise.h"

namespace v3d::sim {

SimulatedClock simulated_clock(int camera, uint64_t seed, MonotonicInstant origin) {
  const uint64_t own = mix(seed ^ 0xC10C) + static_cast<uint64_t>(camera);
  return {from_seconds(uniform(own, 0, 1, 1000)), uniform(own, 1, -50, 50), origin};
}

Duration exposure_delay(int camera, int64_t edge, uint64_t seed) {
  const uint64_t own = mix(mix(seed ^ 0xDE1A) + static_cast<uint64_t>(camera));
  return Duration(static_cast<int64_t>(uniform(own, static_cast<uint64_t>(edge), 4000, 30000)));
}

}  // namespace v3d::sim
