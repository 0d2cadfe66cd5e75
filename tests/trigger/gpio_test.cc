#include "trigger/gpio.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <condition_variable>
#include <deque>
#include <latch>
#include <mutex>

#include "base/core/error.h"
#include "slow_host.h"
#include "support/message_of.h"
#include "trigger/pulse_generator.h"

namespace v3d::trigger {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;
using testing::ElementsAre;
using testing::HasSubstr;

const StudioLine kTrigger{.chip = "gpiochip0", .line = "TRIGGER"};

/// Records the levels of an output line with their times on the host's clock.
struct Script {
  struct Change {
    bool active;
    MonotonicInstant at;
  };
  std::mutex mutex;
  std::vector<Change> changes;
  int64_t opened = 0;
  bool gone = false;
  HostClock clock;

  std::vector<Duration> changes_to(bool active) {
    const std::lock_guard lock(mutex);
    std::vector<Duration> found;
    for (const Change& c : changes) {
      if (c.active == active) found.push_back(c.at - MonotonicInstant(seconds(100)));
    }
    return found;
  }
};

class ScriptedOutput : public OutputLine {
 public:
  explicit ScriptedOutput(Script& script) : script_(script) { ++script.opened; }
  bool set(bool active) override {
    const std::lock_guard lock(script_.mutex);
    if (script_.gone) return false;
    script_.changes.push_back({active, script_.clock.now()});
    return true;
  }

 private:
  Script& script_;
};

OpenOutputLine opener(Script& script) {
  return [&](const StudioLine&) { return std::make_unique<ScriptedOutput>(script); };
}

bool eventually(const std::function<bool()>& condition) {
  const auto deadline = Monotonic::now() + seconds(10);
  while (!condition()) {
    if (Monotonic::now() > deadline) return false;
    std::this_thread::yield();
  }
  return true;
}

PulseTrain train_of(double rate_hz, std::optional<int64_t> count) {
  return {.rate_hz = rate_hz, .width = milliseconds(2), .count = count};
}

TEST(GpioGenerator, starts_and_ends_every_pulse_on_time) {
  SlowHost host;
  Script script;
  script.clock = host.clock();
  GpioGenerator generator(kTrigger, opener(script), host.clock());
  generator.arm(train_of(25, 3));
  generator.start();
  ASSERT_TRUE(eventually([&] { return generator.finished(); }));
  EXPECT_THAT(script.changes_to(true),
              ElementsAre(milliseconds(20), milliseconds(60), milliseconds(100)));
  EXPECT_THAT(script.changes_to(false),
              ElementsAre(milliseconds(22), milliseconds(62), milliseconds(102)));
  EXPECT_EQ(generator.commanded(), 3);
  EXPECT_EQ(generator.fault(), "");
}

TEST(GpioGenerator, makes_a_late_pulse_with_full_width_and_skips_one_that_is_too_late) {
  // Pulse 1 is 9 ms late. Pulse 3 is 10 ms late, a quarter of a period, and is skipped.
  const auto due = [](int k) { return MonotonicInstant(seconds(100) + milliseconds(20 + 40 * k)); };
  SlowHost host({{due(1), milliseconds(9)}, {due(3), milliseconds(10)}});
  Script script;
  script.clock = host.clock();
  GpioGenerator generator(kTrigger, opener(script), host.clock());
  generator.arm(train_of(25, 5));
  generator.start();
  ASSERT_TRUE(eventually([&] { return generator.finished(); }));
  EXPECT_THAT(script.changes_to(true), ElementsAre(milliseconds(20), milliseconds(69),
                                                   milliseconds(100), milliseconds(180)));
  EXPECT_THAT(script.changes_to(false), ElementsAre(milliseconds(22), milliseconds(71),
                                                    milliseconds(102), milliseconds(182)));
  EXPECT_EQ(generator.commanded(), 5);
  EXPECT_EQ(generator.fault(), "1 pulses skipped: this host was up to 10 ms late");
  EXPECT_EQ(generator.statistics().jitter_max, milliseconds(10));
  EXPECT_EQ(generator.statistics().late, 2);
}

TEST(GpioGenerator, leaves_the_line_inactive_when_it_is_stopped_or_destroyed_during_a_pulse) {
  SlowHost host;
  Script script;
  script.clock = host.clock();
  std::latch stopped(1);
  HostClock clock = host.clock();
  clock.sleep_until = [&, sleep_until = clock.sleep_until](MonotonicInstant until) {
    if (!script.changes_to(true).empty()) stopped.wait();  // within the first pulse
    sleep_until(until);
  };
  {
    GpioGenerator generator(kTrigger, opener(script), clock);
    generator.arm({.rate_hz = 20, .width = milliseconds(25), .count = {}});
    generator.start();
    EXPECT_TRUE(eventually([&] { return !script.changes_to(true).empty(); }));
    generator.stop();
    stopped.count_down();
  }
  EXPECT_EQ(script.changes_to(true).size(), 1U);
  EXPECT_FALSE(script.changes.back().active);
}

TEST(GpioGenerator, reports_a_lost_line_and_opens_it_again_in_arm) {
  Script script;
  script.clock = HostClock();
  GpioGenerator generator(kTrigger, opener(script));
  generator.arm(train_of(100, {}));
  generator.start();
  ASSERT_TRUE(eventually([&] { return generator.commanded() >= 2; }));
  {
    const std::lock_guard lock(script.mutex);
    script.gone = true;
  }
  ASSERT_TRUE(eventually([&] { return generator.finished(); }));
  EXPECT_EQ(generator.fault(), "GPIO line TRIGGER of gpiochip0 is gone");
  script.gone = false;
  generator.arm(train_of(100, 1));
  EXPECT_EQ(generator.fault(), "");
}

TEST(GpioGenerator, opens_the_line_once_and_makes_it_inactive) {
  Script script;
  script.clock = HostClock();
  GpioGenerator generator(kTrigger, opener(script));
  EXPECT_EQ(script.opened, 0);
  generator.silence();
  EXPECT_EQ(script.opened, 1);
  generator.silence();
  EXPECT_EQ(script.opened, 1);
  EXPECT_FALSE(script.changes.back().active);
}

TEST(GpioGenerator, rejects_pulses_longer_than_half_a_period_and_names_a_missing_chip) {
  GpioGenerator absent({.chip = "/nonexistent/chip", .line = "3"});
  const auto refusal = [&](const PulseTrain& train) {
    return test::message_of<InputError>([&] { absent.arm(train); });
  };
  EXPECT_THAT(refusal({.rate_hz = 25, .width = milliseconds(21), .count = {}}),
              HasSubstr("at most 20000 us"));
  EXPECT_THAT(refusal(train_of(1001, {})), HasSubstr("0.01 to 1000 Hz"));
  EXPECT_THAT(refusal(train_of(25, {})), HasSubstr("GPIO chip /nonexistent/chip: "));
}

/// Queue of edges that a test puts on an input line.
struct EdgeScript {
  std::mutex mutex;
  std::condition_variable changed;
  std::deque<LineEdge> edges;
  bool gone = false;

  void put(bool active, Duration at) {
    const std::lock_guard lock(mutex);
    edges.push_back({active, start + at});
    changed.notify_one();
  }
  const MonotonicInstant start = Monotonic::now();
  void vanish() {
    const std::lock_guard lock(mutex);
    gone = true;
    changed.notify_one();
  }
};

class ScriptedInput : public InputLine {
 public:
  explicit ScriptedInput(EdgeScript& script) : script_(script) {}
  std::optional<LineEdge> wait(MonotonicInstant deadline) override {
    std::unique_lock lock(script_.mutex);
    script_.changed.wait_for(lock, deadline - Monotonic::now(),
                             [&] { return script_.gone || !script_.edges.empty(); });
    if (script_.edges.empty()) return {};
    const LineEdge edge = script_.edges.front();
    script_.edges.pop_front();
    return edge;
  }
  bool gone() const override {
    const std::lock_guard lock(script_.mutex);
    return script_.gone && script_.edges.empty();
  }

 private:
  EdgeScript& script_;
};

OpenInputLine opener(EdgeScript& script) {
  return [&](const StudioLine&) { return std::make_unique<ScriptedInput>(script); };
}

std::optional<SensedPulse> next_of(GpioSensor& sensor) {
  return sensor.wait(Monotonic::now() + seconds(10));
}

TEST(GpioSensor, reports_every_pulse_with_its_first_edge_and_its_width) {
  EdgeScript script;
  for (int k = 0; k < 40; ++k) {
    script.put(true, k * milliseconds(40));
    script.put(false, k * milliseconds(40) + milliseconds(1));
  }
  GpioSensor sensor(kTrigger, opener(script));
  sensor.reset();
  for (int k = 0; k < 40; ++k) {
    const auto pulse = next_of(sensor);
    ASSERT_TRUE(pulse);
    EXPECT_EQ(pulse->number, k);
    EXPECT_EQ(pulse->at, script.start + k * milliseconds(40));
    EXPECT_EQ(pulse->width, milliseconds(1));
  }
}

TEST(GpioSensor, reports_a_pulse_whose_end_was_lost_and_none_for_a_lost_start) {
  EdgeScript script;
  script.put(false, milliseconds(-10));
  script.put(true, milliseconds(0));
  script.put(true, milliseconds(40));
  script.put(false, milliseconds(41));
  GpioSensor sensor(kTrigger, opener(script));
  sensor.reset();
  EXPECT_EQ(next_of(sensor)->width, std::nullopt);
  EXPECT_TRUE(next_of(sensor)->width);
  EXPECT_FALSE(sensor.wait(Monotonic::now() + milliseconds(1)));
}

TEST(GpioSensor, reports_the_width_of_a_pulse_whose_edges_are_read_seconds_late) {
  EdgeScript script;
  script.put(true, -seconds(3));
  script.put(false, -seconds(3) + milliseconds(1));
  GpioSensor sensor(kTrigger, opener(script));
  sensor.reset();
  const auto pulse = next_of(sensor);
  ASSERT_TRUE(pulse);
  EXPECT_EQ(pulse->width, milliseconds(1));
}

TEST(GpioSensor, reports_a_pulse_without_an_end_when_no_edge_follows) {
  EdgeScript script;
  script.put(true, -seconds(3));
  GpioSensor sensor(kTrigger, opener(script));
  sensor.reset();
  const auto pulse = next_of(sensor);
  ASSERT_TRUE(pulse);
  EXPECT_EQ(pulse->width, std::nullopt);
}

TEST(GpioSensor, reports_a_lost_line_and_restarts_its_count_at_reset) {
  EdgeScript script;
  GpioSensor sensor(kTrigger, opener(script));
  EXPECT_THAT(sensor.fault(), HasSubstr("not read yet"));
  sensor.reset();
  script.put(true, milliseconds(0));
  script.put(false, milliseconds(1));
  EXPECT_EQ(next_of(sensor)->number, 0);
  script.vanish();
  ASSERT_TRUE(eventually([&] { return !sensor.fault().empty(); }));
  EXPECT_EQ(sensor.fault(), "GPIO line TRIGGER of gpiochip0 is gone");
  EXPECT_FALSE(sensor.wait(Monotonic::now() + milliseconds(1)));
  script.gone = false;
  sensor.reset();
  EXPECT_EQ(sensor.fault(), "");
  script.put(true, milliseconds(0));
  script.put(false, milliseconds(1));
  EXPECT_EQ(next_of(sensor)->number, 0);
}

TEST(MakeTrigger, makes_a_gpio_trigger_and_a_sensor_only_for_a_configured_sense_line) {
  StudioTrigger trigger;
  trigger.kind = TriggerKind::kGpio;
  trigger.output = kTrigger;
  const auto generator = make_generator(trigger);
  ASSERT_TRUE(generator);
  EXPECT_FALSE(make_sensor(trigger, *generator));
  trigger.sense = StudioLine{.chip = "gpiochip0", .line = "SENSE"};
  EXPECT_TRUE(make_sensor(trigger, *generator));
}

}  // namespace
}  // namespace v3d::trigger
