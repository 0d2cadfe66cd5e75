#include "trigger/background_generator.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <condition_variable>
#include <mutex>

#include "base/core/error.h"
#include "support/child_process.h"
#include "support/message_of.h"

namespace v3d::trigger {
namespace {

using test::becomes_true;
using test::within;
using testing::HasSubstr;

/// Controls and records the calls of HangingGenerator.
struct Bench {
  void hang_in(const std::string& call) {
    const std::lock_guard lock(mutex);
    hangs_in = call;
    changed.notify_all();
  }
  void enter(const std::string& call) {
    std::unique_lock lock(mutex);
    calls.push_back(call);
    changed.wait(lock, [&] { return hangs_in != call; });
  }
  std::vector<std::string> recorded_calls() {
    const std::lock_guard lock(mutex);
    return calls;
  }

  std::mutex mutex;
  std::condition_variable changed;
  std::string hangs_in;
  std::vector<std::string> calls;
  bool is_plugged_in = true;
  std::string fault;  ///< of the generator; change it while no call runs
};

/// A generator whose calls block while bench.hangs_in names them.
class HangingGenerator : public PulseGenerator {
 public:
  explicit HangingGenerator(Bench& bench) : bench_(bench) {}
  void silence() override { bench_.enter("silence"); }
  void arm(const PulseTrain&) override {
    bench_.enter("arm");
    if (!bench_.is_plugged_in) throw InputError("usb:0957:2c07: was unplugged");
    running_ = false;
  }
  void start() override {
    bench_.enter("start");
    running_ = true;
  }
  void stop() override {
    bench_.enter("stop");
    running_ = false;
  }
  int64_t commanded() const override { return running_ ? 7 : 8; }
  std::optional<MonotonicInstant> first_pulse() const override { return {}; }
  bool finished() const override { return !running_; }
  PulseStatistics statistics() const override { return {}; }
  std::string fault() const override { return bench_.fault; }

 private:
  Bench& bench_;
  bool running_ = false;
};

class BackgroundGeneratorTest : public testing::Test {
 protected:
  void arm() {
    generator_.arm({});
    ASSERT_TRUE(becomes_true([&] { return generator_.armed(); }, within(10)));
  }
  explicit BackgroundGeneratorTest(Duration max_wait = std::chrono::minutes(1))
      : generator_(std::make_unique<HangingGenerator>(bench_), max_wait) {}
  ~BackgroundGeneratorTest() override { bench_.hang_in(""); }

  Bench bench_;
  BackgroundGenerator generator_;
};

class HangingBackgroundGenerator : public BackgroundGeneratorTest {
 protected:
  HangingBackgroundGenerator() : BackgroundGeneratorTest(std::chrono::milliseconds(100)) {}
  /// False when the generator has not started in time.
  bool starts() {
    try {
      generator_.start();
      return true;
    } catch (const InputError&) {
      return false;
    }
  }
};

TEST_F(BackgroundGeneratorTest, arms_starts_and_stops_in_order) {
  arm();
  EXPECT_TRUE(generator_.finished());
  generator_.start();
  EXPECT_FALSE(generator_.finished());
  EXPECT_EQ(generator_.commanded(), 7);
  generator_.stop();
  generator_.stop();
  EXPECT_TRUE(generator_.finished());
  EXPECT_EQ(generator_.commanded(), 8);
  EXPECT_EQ(generator_.fault(), "");
  EXPECT_THAT(bench_.recorded_calls(), testing::ElementsAre("arm", "start", "stop"));
}

TEST_F(HangingBackgroundGenerator, does_not_wait_for_an_instrument_that_hangs_in_arm) {
  bench_.hang_in("arm");
  generator_.arm({});
  EXPECT_FALSE(generator_.armed());
  EXPECT_EQ(generator_.commanded(), 0);
  generator_.stop();
  EXPECT_EQ(generator_.fault(), "") << "it was never started";
  generator_.arm({});
  EXPECT_FALSE(generator_.armed()) << "the first arm() still runs";
  bench_.hang_in("");
  EXPECT_TRUE(becomes_true([&] { return generator_.armed(); }, within(10)));
  EXPECT_THAT(bench_.recorded_calls(), testing::ElementsAre("arm", "stop", "arm"));
}

TEST_F(BackgroundGeneratorTest, reports_an_arm_failure_once_and_arms_again) {
  bench_.is_plugged_in = false;
  generator_.arm({});
  const auto failure = [&] {
    return test::message_of<InputError>(
        [&] { becomes_true([&] { return generator_.armed(); }, within(10)); });
  };
  EXPECT_EQ(failure(), "usb:0957:2c07: was unplugged");
  bench_.is_plugged_in = true;
  arm();
}

TEST_F(HangingBackgroundGenerator, stops_a_generator_that_starts_too_late) {
  arm();
  bench_.hang_in("start");
  EXPECT_THAT(test::message_of<InputError>([&] { generator_.start(); }),
              HasSubstr("does not start"));
  generator_.stop();
  EXPECT_TRUE(generator_.finished());
  EXPECT_THAT(generator_.fault(), HasSubstr("pulses may continue"));
  bench_.hang_in("");
  EXPECT_TRUE(becomes_true([&] { return generator_.fault().empty(); }, within(10)));
  EXPECT_EQ(bench_.recorded_calls().back(), "stop");
}

TEST_F(HangingBackgroundGenerator, reports_that_pulses_may_continue_until_stop_succeeds) {
  arm();
  ASSERT_TRUE(becomes_true([&] { return starts(); }, within(60)));
  bench_.hang_in("stop");
  generator_.stop();
  EXPECT_TRUE(generator_.finished());
  EXPECT_EQ(generator_.commanded(), 7);
  EXPECT_THAT(generator_.fault(), HasSubstr("pulses may continue"));
  bench_.hang_in("");
  EXPECT_TRUE(becomes_true([&] { return generator_.fault().empty(); }, within(10)));
  EXPECT_EQ(generator_.commanded(), 8);
}

TEST_F(BackgroundGeneratorTest, stops_again_after_a_stop_that_failed_and_never_a_running_train) {
  bench_.fault = "pulses may continue: usb:0957:2c07: was unplugged";
  arm();
  generator_.start();
  generator_.retry_stop();
  generator_.stop();
  bench_.hang_in("stop");
  generator_.retry_stop();
  generator_.retry_stop();
  EXPECT_EQ(generator_.fault(), bench_.fault) << "the second stop still runs";
  bench_.hang_in("");
  generator_.silence();  // waits for the stop
  EXPECT_THAT(bench_.recorded_calls(),
              testing::ElementsAre("arm", "start", "stop", "stop", "silence"));
  bench_.fault.clear();
  generator_.retry_stop();
  EXPECT_EQ(bench_.recorded_calls().size(), 5U);
}

TEST_F(HangingBackgroundGenerator, reports_that_pulses_may_continue_while_it_is_armed_again) {
  bench_.fault = "pulses may continue: usb:0957:2c07: was unplugged";
  bench_.hang_in("arm");
  generator_.arm({});
  EXPECT_EQ(generator_.fault(), bench_.fault);
}

}  // namespace
}  // namespace v3d::trigger
