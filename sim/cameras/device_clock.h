// Simulated camera clocks with offset and drift.
#pragma once

#include <cstdint>

#include "base/core/time.h"

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

/// The clock of a camera: a random offset within 1000 s and a random drift within 50 ppm. At
/// `origin` the clock shows its offset.
SimulatedClock simulated_clock(int camera, uint64_t seed, MonotonicInstant origin);

/// Random delay from a trigger edge to the start of exposure, 4 to 30 microseconds.
Duration exposure_delay(int camera, int64_t edge, uint64_t seed);

}  // namespace v3d::sim
