// The cameras' own clocks: each has its own zero and runs a little fast or slow.
#pragma once

#include <cstdint>

#include "base/time.h"

namespace v3d::sim {

struct SimulatedClock {
  Duration offset{};     ///< the device's reading when CLOCK_MONOTONIC is `origin`
  double drift_ppm = 0;  ///< how much faster than CLOCK_MONOTONIC it runs
  MonotonicInstant origin;

  DeviceInstant at(MonotonicInstant t) const {
    const Duration since = t - origin;
    const auto gained = static_cast<int64_t>(static_cast<double>(since.count()) * drift_ppm * 1e-6);
    return DeviceInstant(offset + since + Duration(gained));
  }
};

/// The clock of the camera with this index: an offset of up to 1000 s and a drift of up to 50 ppm,
/// both ways; it reads its offset at `origin`.
SimulatedClock simulated_clock(int camera, uint64_t seed, MonotonicInstant origin);

/// From the edge to the start of exposure: 4 to 30 microseconds, another at every edge.
Duration exposure_delay(int camera, int64_t edge, uint64_t seed);

}  // namespace v3d::sim
