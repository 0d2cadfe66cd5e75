#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include "trigger/pulse_generator.h"

namespace v3d::trigger {
namespace {

using std::chrono::milliseconds;
using testing::ElementsAre;

constexpr PulseTrain kTrain{.rate_hz = 25, .width = milliseconds(1), .count = {}};

MonotonicInstant at(Duration t) { return MonotonicInstant(std::chrono::seconds(9) + t); }

SensedPulse pulse_at(Duration t, std::optional<Duration> width = {}) {
  return {.number = 0, .at = at(t), .width = width};
}

TEST(SensedTrain, skips_the_numbers_of_missing_pulses) {
  SensedTrain train(kTrain);
  EXPECT_EQ(train.number(pulse_at(milliseconds(0))), 0);
  EXPECT_EQ(train.number(pulse_at(milliseconds(40))), 1);
  EXPECT_EQ(train.number(pulse_at(milliseconds(160))), 4);
  EXPECT_EQ(train.number(pulse_at(milliseconds(200))), 5);
  EXPECT_EQ(train.sensed(), 4);
  EXPECT_EQ(train.extra(), 0);
}

TEST(SensedTrain, counts_extra_pulses_between_those_of_the_train_without_changing_numbers) {
  SensedTrain train(kTrain);
  EXPECT_EQ(train.number(pulse_at(milliseconds(0))), 0);
  EXPECT_EQ(train.number(pulse_at(milliseconds(3))), std::nullopt);
  EXPECT_EQ(train.number(pulse_at(milliseconds(19))), std::nullopt);
  EXPECT_EQ(train.number(pulse_at(milliseconds(40))), 1);
  EXPECT_EQ(train.number(pulse_at(milliseconds(80))), 2);
  EXPECT_EQ(train.sensed(), 3);
  EXPECT_EQ(train.extra(), 2);
}

TEST(SensedTrain, distinguishes_a_runt_of_the_train_from_a_spike_between_pulses) {
  SensedTrain train(kTrain);
  const Duration good = milliseconds(1);
  const Duration runt = std::chrono::microseconds(400);
  EXPECT_EQ(train.number(pulse_at(milliseconds(0), good)), 0);
  EXPECT_EQ(train.number(pulse_at(milliseconds(40), runt)), 1);
  EXPECT_EQ(train.number(pulse_at(milliseconds(70), runt)), std::nullopt);
  EXPECT_EQ(train.number(pulse_at(milliseconds(80), good)), 2);
  EXPECT_THAT(train.runts(), ElementsAre(1));
  EXPECT_EQ(train.extra(), 1);
}

/// The clock has an error of 200 ppm, pulses jitter by an eighth of a period, and there are gaps
/// and bounces.
RC_GTEST_PROP(SensedTrain, numbers_a_train_with_jitter_gaps_and_bounces_correctly_for_an_hour, ()) {
  const Duration true_period = std::chrono::microseconds(40'008);
  SensedTrain train(kTrain);
  RC_ASSERT(train.number(pulse_at({})) == 0);
  int64_t pulse = 0;
  int64_t bounces = 0;
  for (const int gap : *rc::gen::container<std::vector<int>>(rc::gen::inRange(1, 100))) {
    pulse += gap;
    const Duration jitter = *rc::gen::inRange(-5, 6) * milliseconds(1);
    RC_ASSERT(train.number(pulse_at(pulse * true_period + jitter)) == pulse);
    if (!*rc::gen::arbitrary<bool>()) continue;
    const Duration bounce = *rc::gen::inRange(1, 20) * milliseconds(1);
    RC_ASSERT(!train.number(pulse_at(pulse * true_period + jitter + bounce)));
    ++bounces;
  }
  RC_ASSERT(train.extra() == bounces);
}

}  // namespace
}  // namespace v3d::trigger
