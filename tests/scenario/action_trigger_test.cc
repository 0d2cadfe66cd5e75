// Cameras that are triggered by action commands, with the real daemons.
#include <gmock/gmock.h>

#include "studio4.h"
#include "take/ledger/ledger.h"
#include "take/ledger/verify.h"

namespace v3d::test {
namespace {

using testing::AllOf;
using testing::Contains;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::IsSubsetOf;
using testing::IsSupersetOf;
using testing::Not;

constexpr int kPulses = 30;

/// At 4 Hz: at a higher rate, a busy machine skips pulses. A command that is 50 ms late is skipped.
Studio4Options two_cameras(const std::string& faults, const std::vector<std::string>& more) {
  Studio4Options options{
      .cameras = 2, .faults = faults, .rate = "4", .simulator = {"--trigger", "action"}};
  options.simulator.insert(options.simulator.end(), more.begin(), more.end());
  return options;
}

class ActionStudio : public Studio4 {
 protected:
  explicit ActionStudio(const std::string& faults = {}, const std::vector<std::string>& more = {})
      : Studio4(two_cameras(faults, more)) {}

  /// Records a take of kPulses and returns the ledger of its node.
  take::Ledger record() {
    is_late_ = trigger_is_late();  // of the background
    arm_and_start(kPulses);
    EXPECT_TRUE(becomes_idle()) << log();
    is_late_ |= trigger_is_late();
    return take::load_ledger(take().ledger());
  }

  /// The trigger of a busy machine reports pulses that were late by a tenth of a period or more, or
  /// skipped.
  bool trigger_is_late() { return value("cap01", "trigger_late") > 0; }

  /// Every pulse is sensed or listed as not sensed, and most are sensed.
  static void expect_all_accounted_for(const take::Ledger& ledger) {
    EXPECT_EQ(ledger.commanded, kPulses);
    EXPECT_EQ(ledger.sensed.value_or(0) + std::ssize(ledger.unsensed), kPulses);
    EXPECT_GT(2 * ledger.sensed.value_or(0), kPulses) << "this machine does not reach 4 Hz";
  }

  /// Every pulse is recorded by all cameras, except for those that a late trigger skips: it reports
  /// them. A late command without a time makes late, suspect frames.
  void expect_all_pulses(const take::Ledger& ledger) {
    expect_all_accounted_for(ledger);
    const std::string text = client_->health(within(5))["cap01"].text;
    const bool is_whole = ledger.unsensed.empty();
    EXPECT_TRUE(is_whole || text.find("pulses skipped: this host was") != std::string::npos)
        << text;
    ASSERT_EQ(ledger.cameras.size(), 2U);
    for (const take::CameraLedger& camera : ledger.cameras) {
      EXPECT_EQ(camera.written, ledger.sensed) << camera.name;
      EXPECT_EQ(camera.missing, ledger.unsensed) << camera.name;
      EXPECT_TRUE(camera.suspect.empty() || is_late_) << camera.name;
    }
  }

  bool is_late_ = false;  ///< the trigger, in the background or the take
};

TEST_F(ActionStudio, records_every_pulse_that_is_commanded_without_a_cable) {
  const take::Ledger ledger = record();
  expect_all_pulses(ledger);
  EXPECT_THAT(verify_take(take()).disagreements, IsEmpty());
  EXPECT_THAT(log(), Not(HasSubstr("action commands")));
}

class ActionStudioWithLoss : public ActionStudio {
 protected:
  ActionStudioWithLoss()
      : ActionStudio(
            "[[fault]]\ncamera = \"cam02\"\npulse = 7\nkind = \"missed\"\n"
            "[[fault]]\ncamera = \"cam02\"\npulse = 12\nkind = \"missed\"\n"
            "[[fault]]\ncamera = \"cam01\"\npulse = 20\nkind = \"missed\"\n"
            "[[fault]]\ncamera = \"cam02\"\npulse = 20\nkind = \"missed\"\n") {}
};

TEST_F(ActionStudioWithLoss, names_the_pulses_whose_command_did_not_reach_a_camera) {
  const take::Ledger ledger = record();
  expect_all_accounted_for(ledger);
  ASSERT_EQ(ledger.cameras.size(), 2U);
  const take::CameraLedger &cam01 = ledger.cameras[0], &cam02 = ledger.cameras[1];
  EXPECT_EQ(cam01.missing, ledger.unsensed) << "no camera acknowledged it";
  EXPECT_EQ(cam02.missing.size(), ledger.unsensed.size() + 2);
  if (!is_late_) {  // else further pulses are skipped, and the simulator counts commands
    EXPECT_EQ(ledger.sensed, kPulses - 1);
    EXPECT_THAT(ledger.unsensed, ElementsAre(20));
    EXPECT_THAT(cam02.missing, ElementsAre(7, 12, 20));
    // As with a cable, the next frame is suspect: the counter of the camera left out no number. A
    // busy machine may deliver a frame late, which makes it suspect, too.
    EXPECT_THAT(cam01.suspect, AllOf(Contains(21), IsSubsetOf({21, 22, 23})));
    EXPECT_THAT(cam02.suspect,
                AllOf(IsSupersetOf({8, 13, 21}), IsSubsetOf({8, 9, 10, 13, 14, 15, 21, 22, 23})));
  }
  const std::string warning = "4 acknowledgements of action commands missing: cam01, cam02";
  EXPECT_TRUE(becomes_true([&] { return log().find(warning) != std::string::npos; }, within(60)))
      << log();
  EXPECT_TRUE(reaches("cap01", "trigger_acks_missing", 4));
  EXPECT_EQ(value("cap01", "trigger_acks_rejected"), 0);
}

class ActionStudioWithoutPtp : public ActionStudio {
 protected:
  ActionStudioWithoutPtp() : ActionStudio("", {"--no-ptp"}) {}
};

TEST_F(ActionStudioWithoutPtp, says_at_arming_why_commands_have_no_time_and_records_all_pulses) {
  const control::Answer armed = command(wire::CommandVerb::kArm, kPulses);
  ASSERT_TRUE(armed.done()) << text_of(armed) << log();
  EXPECT_THAT(text_of(armed),
              HasSubstr("unscheduled action commands: PTP is not locked on cam01, cam02"));
  ASSERT_TRUE(command(wire::CommandVerb::kStart).done()) << log();
  ASSERT_TRUE(becomes_idle()) << log();
  is_late_ = trigger_is_late();
  const take::Ledger ledger = take::load_ledger(take().ledger());
  expect_all_pulses(ledger);
  EXPECT_TRUE(ledger.complete() || is_late_) << ledger.verdict();
}

}  // namespace
}  // namespace v3d::test
