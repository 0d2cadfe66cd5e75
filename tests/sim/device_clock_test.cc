#include "sim/cameras/device_clock.h"

#include <gtest/gtest.h>

#include <set>

namespace v3d::sim {
namespace {

TEST(SimulatedClock, has_an_offset_and_a_drift_per_camera) {
  const auto origin = from_ns<Monotonic>(5'000'000'000);
  std::set<int64_t> offsets;
  std::set<double> drifts;
  for (int camera = 0; camera < 15; ++camera) {
    const SimulatedClock clock = simulated_clock(camera, 1, origin);
    offsets.insert(clock.offset.count());
    drifts.insert(clock.drift_ppm);
    EXPECT_LE(std::abs(clock.drift_ppm), 50);
    EXPECT_EQ(clock.at(origin).time_since_epoch(), clock.offset);
    const Duration hour = std::chrono::hours(1);
    const double gained =
        static_cast<double>((clock.at(origin + hour) - clock.at(origin) - hour).count());
    EXPECT_NEAR(gained, clock.drift_ppm * 1e-6 * static_cast<double>(hour.count()), 2);
  }
  EXPECT_EQ(offsets.size(), 15U);
  EXPECT_EQ(drifts.size(), 15U);
}

TEST(SimulatedClock, has_an_exposure_delay_of_4_to_30_microseconds) {
  std::set<int64_t> delays;
  for (int64_t edge = 0; edge < 100; ++edge) {
    const Duration delay = exposure_delay(3, edge, 1);
    EXPECT_GE(delay, std::chrono::microseconds(4));
    EXPECT_LE(delay, std::chrono::microseconds(30));
    delays.insert(delay.count());
  }
  EXPECT_GT(delays.size(), 50U);
}

}  // namespace
}  // namespace v3d::sim
