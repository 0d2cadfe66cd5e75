#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <memory>
#include <utility>

#include "capture/fed_camera.h"
#include "daemon/captured/node_devices.h"

namespace v3d::captured {
namespace {

using testing::ElementsAre;
using testing::IsEmpty;
using testing::SizeIs;

constexpr Duration kPeriod = std::chrono::milliseconds(40);
const MonotonicInstant kFirst{std::chrono::seconds(100)};

/// A generator that counts as a test says.
struct CountingGenerator : trigger::PulseGenerator {
  void silence() override {}
  void arm(const trigger::PulseTrain&) override { count = 0; }
  void start() override {}
  void stop() override {}
  int64_t commanded() const override { return count; }
  std::optional<MonotonicInstant> first_pulse() const override {
    return count > 0 ? std::optional(kFirst) : std::nullopt;
  }
  bool finished() const override { return false; }
  bool is_paced_by_this_host() const override { return is_paced_here; }
  bool counts_exactly() const override { return is_exact; }
  trigger::PulseStatistics statistics() const override { return {}; }
  std::string fault() const override { return problem; }

  std::string problem;
  int64_t count = 0;
  bool is_paced_here = true;
  bool is_exact = true;
};

struct SilentSensor : trigger::PulseSensor {
  void reset() override {}
  std::optional<trigger::SensedPulse> wait(MonotonicInstant) override { return {}; }
  std::string fault() const override { return "the line is not read yet"; }
};

/// A trigger without a sense line.
class UnsensedTrigger : public testing::Test {
 protected:
  UnsensedTrigger() { start(); }

  void start() {
    trigger_.arm({.rate_hz = 25, .width = std::chrono::milliseconds(1), .count = {}});
    trigger_.start();
  }

  CountingGenerator* const generator_ = new CountingGenerator;
  NodeTrigger trigger_{std::unique_ptr<trigger::PulseGenerator>(generator_), nullptr};
};

TEST_F(UnsensedTrigger, that_this_host_paces_reports_every_pulse_once_with_its_time) {
  EXPECT_THAT(trigger_.unsensed_pulses(), IsEmpty());
  generator_->count = 1;
  const auto first = trigger_.unsensed_first_pulse();
  ASSERT_TRUE(first);
  EXPECT_EQ(first->pulse, 0);
  EXPECT_FALSE(first->may_be_early);
  EXPECT_THAT(trigger_.unsensed_pulses(), IsEmpty());
  generator_->count = 50;
  const auto pulses = trigger_.unsensed_pulses();
  ASSERT_THAT(pulses, SizeIs(49));
  EXPECT_EQ(pulses.front().pulse, 1);
  EXPECT_EQ(pulses.front().at, kFirst + kPeriod);
  EXPECT_EQ(pulses.back().pulse, 49);
  EXPECT_EQ(pulses.back().at, kFirst + 49 * kPeriod);
  EXPECT_THAT(trigger_.unsensed_pulses(), IsEmpty());
  start();
  generator_->count = 3;
  ASSERT_TRUE(trigger_.unsensed_first_pulse());
  EXPECT_THAT(trigger_.unsensed_pulses(), SizeIs(2)) << "of the next train";
}

TEST_F(UnsensedTrigger, that_another_device_paces_reports_its_first_pulse_alone_by_the_start) {
  generator_->is_paced_here = false;
  generator_->count = 50;
  const auto first = trigger_.unsensed_first_pulse();
  ASSERT_TRUE(first);
  EXPECT_TRUE(first->may_be_early);
  EXPECT_THAT(trigger_.unsensed_pulses(), IsEmpty());
}

TEST(SensedTrigger, has_outside_a_train_only_the_problem_that_pulses_may_continue) {
  auto* const generator = new CountingGenerator;
  const NodeTrigger trigger(std::unique_ptr<trigger::PulseGenerator>(generator),
                            std::make_unique<SilentSensor>());
  generator->problem = "3 pulses skipped: this host was up to 95 ms late";
  EXPECT_THAT(trigger.problems(true), ElementsAre("trigger: " + generator->problem,
                                                  "sense line: the line is not read yet"));
  EXPECT_THAT(trigger.problems(false), IsEmpty());
  generator->problem = "pulses may continue: was unplugged";
  EXPECT_THAT(trigger.problems(false), ElementsAre("trigger: " + generator->problem));
}

TEST(SensedTrigger, warns_of_a_lost_sense_line_also_where_the_commanded_pulses_are_an_estimate) {
  auto* const generator = new CountingGenerator;
  const NodeTrigger trigger(std::unique_ptr<trigger::PulseGenerator>(generator),
                            std::make_unique<SilentSensor>());
  generator->count = 400;
  EXPECT_EQ(trigger.unsensed_warning(300), "100 pulses commanded but not sensed");
  EXPECT_EQ(trigger.unsensed_warning(395), "");
  generator->is_exact = false;
  EXPECT_EQ(trigger.unsensed_warning(300), "about 100 pulses commanded but not sensed");
  generator->count = 100'000;
  EXPECT_EQ(trigger.unsensed_warning(99'950), "") << "the clocks differ";
}

TEST(SensedTrigger, estimates_the_pulses_where_nothing_counts_them_and_the_sense_line_is_broken) {
  auto* const generator = new CountingGenerator;
  const NodeTrigger trigger(std::unique_ptr<trigger::PulseGenerator>(generator),
                            std::make_unique<SilentSensor>());
  generator->is_exact = false;
  generator->count = 400;
  EXPECT_EQ(trigger.commanded(398), 398) << "the sense line counts better";
  EXPECT_EQ(trigger.commanded(402), 402) << "the clocks differ";
  EXPECT_EQ(trigger.commanded(300), 400);
  EXPECT_EQ(trigger.commanded(0), 400);
}

/// A camera that sends no frames and gives no offset of its clock.
class ClockedCamera : public capture::FedCamera {
 public:
  explicit ClockedCamera(bool is_locked)
      : FedCamera(std::make_shared<capture::FrameSource>()), is_locked_(is_locked) {}
  capture::CameraStatistics statistics() const override {
    capture::CameraStatistics statistics;
    statistics.ptp_locked = is_locked_;
    return statistics;
  }

 private:
  const bool is_locked_;
};

TEST(ClockFault, names_the_cameras_whose_clock_is_not_locked_and_not_those_without_an_offset) {
  Studio studio;
  for (const char* name : {"cam01", "cam02"}) {
    StudioCamera& camera = studio.cameras.emplace_back();
    camera.name = name;
    camera.node = "cap01";
    studio.trigger.action.cameras.push_back({.name = name, .address = "127.0.0.1"});
  }
  NodeCameras cameras(studio, "cap01", [](const StudioCamera& camera) {
    return std::make_unique<ClockedCamera>(camera.name == "cam01");
  });
  cameras.arm(kPeriod, false);
  ASSERT_TRUE(capture::eventually([&] { return cameras.ready().size() == 2; }));
  EXPECT_EQ(cameras.clock_fault(), "PTP is not locked on cam02");
}

}  // namespace
}  // namespace v3d::captured
