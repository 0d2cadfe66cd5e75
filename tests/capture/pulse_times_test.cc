#include "capture/sync/pulse_times.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <numeric>
#include <vector>

namespace v3d::capture {
namespace {

using std::chrono::microseconds;
using std::chrono::milliseconds;
using std::chrono::seconds;

constexpr Duration kPeriod = milliseconds(40);
constexpr MonotonicInstant kStart{seconds(1000)};
constexpr MonotonicInstant kLater{seconds(100'000)};

MonotonicInstant pulse_at(int64_t pulse) { return kStart + pulse * kPeriod; }

std::optional<int64_t> found(const PulseTimes& times, MonotonicInstant at) {
  return times.find(at, {}, kLater).value().pulse;
}

TEST(PulseTimes, finds_the_nearest_pulse_and_none_before_and_after_the_train) {
  PulseTimes times(kPeriod);
  times.begin(kPeriod);
  for (int64_t pulse = 0; pulse < 10; ++pulse) times.add(pulse, pulse_at(pulse));
  EXPECT_EQ(found(times, pulse_at(3) + milliseconds(19)), 3);
  EXPECT_EQ(found(times, pulse_at(4) - milliseconds(19)), 4);
  EXPECT_EQ(found(times, pulse_at(0) - milliseconds(19)), 0);
  EXPECT_EQ(found(times, pulse_at(0) - milliseconds(21)), std::nullopt);
  EXPECT_EQ(found(times, pulse_at(9) + milliseconds(19)), 9);
  EXPECT_EQ(found(times, pulse_at(9) + milliseconds(21)), std::nullopt);
  EXPECT_EQ(times.find(pulse_at(4) - milliseconds(7), {}, kLater)->phase, -milliseconds(7));
  times.end();
  EXPECT_EQ(found(times, pulse_at(3)), std::nullopt);
}

TEST(PulseTimes, interpolates_a_pulse_that_was_not_sensed) {
  PulseTimes gap(kPeriod);
  gap.begin(kPeriod);
  for (const int64_t pulse : {0, 1, 5, 6}) gap.add(pulse, pulse_at(pulse));
  for (int64_t pulse = 0; pulse < 7; ++pulse) {
    EXPECT_EQ(found(gap, pulse_at(pulse) + milliseconds(10)), pulse);
  }
}

TEST(PulseTimes, ignores_a_pulse_whose_number_or_time_is_not_later) {
  PulseTimes times(kPeriod);
  times.begin(kPeriod);
  for (const int64_t pulse : {0, 1, 2}) times.add(pulse, pulse_at(pulse));
  times.add(2, pulse_at(4));
  times.add(3, pulse_at(1));
  times.add(4, pulse_at(4));
  for (int64_t pulse = 0; pulse < 5; ++pulse) EXPECT_EQ(found(times, pulse_at(pulse)), pulse);
}

TEST(PulseTimes, waits_for_a_pulse_that_may_be_reported_later) {
  PulseTimes times(kPeriod);
  times.begin(kPeriod);
  const MonotonicInstant at = pulse_at(0) - milliseconds(10);
  EXPECT_FALSE(times.find(at, {}, at + milliseconds(100)));
  times.add(0, pulse_at(0));
  EXPECT_EQ(times.find(at, {}, at + milliseconds(100))->pulse, 0);
  EXPECT_EQ(times.find(pulse_at(0) + milliseconds(5), {}, pulse_at(0) + milliseconds(6))->pulse, 0);
  const MonotonicInstant between = pulse_at(0) + milliseconds(30);
  EXPECT_FALSE(times.find(between, {}, between + milliseconds(1)));
  EXPECT_EQ(times.find(between, {}, between + kPeriod / 2 + PulseTimes::kMaxSenseDelay * 2)->pulse,
            std::nullopt);
}

/// Pulse numbers of a camera's frames, in order.
std::vector<int64_t> numbers(const PulseTimes& times, const std::vector<MonotonicInstant>& frames) {
  std::vector<int64_t> result;
  std::optional<Duration> before;
  for (const MonotonicInstant at : frames) {
    const auto place = times.find(at, before, kLater).value();
    if (place.phase) before = place.phase;
    if (!place.pulse) continue;
    result.push_back(*place.pulse);
  }
  return result;
}

RC_GTEST_PROP(PulseTimes, labels_every_pulse_once_if_frames_lie_half_way_between_pulses, ()) {
  PulseTimes times(kPeriod);
  times.begin(kPeriod);
  const auto late_pulse = *rc::gen::inRange<int64_t>(0, 5);
  for (int64_t pulse = 0; pulse < 200; ++pulse) {
    const int late_us = pulse % 5 == late_pulse ? *rc::gen::inRange(0, 30'000) : 0;
    times.add(pulse, pulse_at(pulse) + microseconds(late_us));
  }
  const Duration phase = microseconds(*rc::gen::inRange(-20'000, 20'001));
  std::vector<MonotonicInstant> frames;
  for (int64_t pulse = -2; pulse < 202; ++pulse) {
    frames.push_back(pulse_at(pulse) + phase + microseconds(*rc::gen::inRange(-1500, 1501)));
  }
  std::vector<int64_t> all(200);
  std::iota(all.begin(), all.end(), 0);
  RC_ASSERT(numbers(times, frames) == all);
}

RC_GTEST_PROP(PulseTimes, slips_by_exactly_one_pulse_if_a_camera_is_slow_or_fast, ()) {
  PulseTimes times(kPeriod);
  times.begin(kPeriod);
  for (int64_t pulse = 0; pulse < 250; ++pulse) times.add(pulse, pulse_at(pulse));
  const Duration error = microseconds(*rc::gen::elementOf(std::vector<int>{-200, -150, 150, 200}));
  std::vector<MonotonicInstant> frames;
  for (int64_t i = 0; i < 240; ++i) frames.push_back(pulse_at(i) + milliseconds(2) + i * error);
  const std::vector<int64_t> got = numbers(times, frames);
  int64_t slips = 0;
  for (size_t i = 1; i < got.size(); ++i) {
    RC_ASSERT(got[i] - got[i - 1] >= 0 && got[i] - got[i - 1] <= 2);
    slips += got[i] - got[i - 1] - 1;
  }
  RC_ASSERT(slips == (error > Duration::zero() ? 1 : -1));
}

}  // namespace
}  // namespace v3d::capture
