// Cameras that are triggered by action commands, with the real daemons.
#include <gmock/gmock.h>

#include "base/io/action_packet.h"
#include "studio4.h"
#include "take/ledger/ledger.h"
#include "take/ledger/verify.h"

namespace v3d::test {
namespace {

using testing::AllOf;
using testing::AnyOf;
using testing::Contains;
using testing::Each;
using testing::ElementsAre;
using testing::Ge;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::IsSubsetOf;
using testing::IsSupersetOf;

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

  /// Records a take of kPulses, in which `lost` commands do not reach a camera, and returns the
  /// ledger of its node.
  take::Ledger record(int lost = 0) {
    note_lateness(0);  // of the background
    arm_and_start(kPulses);
    EXPECT_TRUE(becomes_idle()) << log();
    note_lateness(lost);
    return take::load_ledger(take().ledger());
  }

  /// The trigger of a busy machine reports pulses that were late by a tenth of a period or more, or
  /// skipped. Its cameras may reject commands as late, or acknowledge them too late.
  void note_lateness(int lost) {
    is_late_ |= value("cap01", "trigger_late") > 0;
    has_late_commands_ |= value("cap01", "trigger_acks_rejected") > 0 ||
                          value("cap01", "trigger_acks_missing") > lost;
  }

  /// Every pulse is sensed or listed as not sensed, and most are sensed.
  static void expect_all_accounted_for(const take::Ledger& ledger) {
    EXPECT_EQ(ledger.commanded, kPulses);
    EXPECT_EQ(ledger.sensed.value_or(0) + std::ssize(ledger.unsensed), kPulses);
    EXPECT_GT(2 * ledger.sensed.value_or(0), kPulses) << "this machine does not reach 4 Hz";
  }

  /// The camera lacks the pulses that were not sensed. A late command is not sensed, but the camera
  /// executes it. After a pulse that a late trigger skipped, a late frame may have its number, but
  /// is suspect then.
  void expect_unsensed_missing(const take::CameraLedger& camera, const take::Ledger& ledger) const {
    if (has_late_commands_) {
      EXPECT_THAT(camera.missing, IsSubsetOf(ledger.unsensed)) << camera.name;
    } else if (is_late_) {
      EXPECT_EQ(camera.missing.size(), ledger.unsensed.size()) << camera.name;
      std::vector<int64_t> missing_or_suspect = camera.missing;
      std::ranges::copy(camera.suspect, std::back_inserter(missing_or_suspect));
      EXPECT_THAT(ledger.unsensed, IsSubsetOf(missing_or_suspect)) << camera.name;
    } else {
      EXPECT_EQ(camera.missing, ledger.unsensed) << camera.name;
    }
  }

  /// Every pulse is recorded by all cameras, except for those that a late trigger skips. The node
  /// reports why a pulse was not sensed. A late command makes late, suspect frames.
  void expect_all_pulses(const take::Ledger& ledger) {
    expect_all_accounted_for(ledger);
    if (!ledger.unsensed.empty()) {
      const auto names_the_cause = [&] {
        return testing::Matches(AnyOf(HasSubstr("pulses skipped: this host was"),
                                      HasSubstr("acknowledgements of action commands missing: "),
                                      HasSubstr("action commands rejected: ")))(log());
      };
      EXPECT_TRUE(becomes_true(names_the_cause, within(60))) << log();
    }
    ASSERT_EQ(ledger.cameras.size(), 2U);
    for (const take::CameraLedger& camera : ledger.cameras) {
      expect_unsensed_missing(camera, ledger);
      // A late frame of the last pulse may have the number after it, but is suspect then.
      const auto beyond =
          std::ranges::count_if(camera.suspect, [](int64_t pulse) { return pulse >= kPulses; });
      const auto frames = camera.written - std::ssize(camera.duplicate) - beyond;
      EXPECT_EQ(frames + std::ssize(camera.missing), kPulses) << camera.name;
      const bool some_are_late = !is_scheduled_ && 2 * std::ssize(camera.suspect) < kPulses;
      EXPECT_TRUE(camera.suspect.empty() || some_are_late || is_late_ || has_late_commands_)
          << camera.name;
    }
  }

  /// Otherwise a camera executes a command when it arrives: late, where the machine of the
  /// simulated cameras is busy. Its frame is suspect then.
  bool is_scheduled_ = true;
  bool is_late_ = false;            ///< the trigger, in the background or the take
  bool has_late_commands_ = false;  ///< the cameras, in the background or the take
};

TEST_F(ActionStudio, records_every_pulse_that_is_commanded_without_a_cable) {
  const take::Ledger ledger = record();
  expect_all_pulses(ledger);
  EXPECT_THAT(verify_take(take()).disagreements, IsEmpty());
  EXPECT_TRUE(has_late_commands_ || log().find("action commands") == std::string::npos) << log();
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

/// The commands that the second of two cameras missed and the first did not, counted without those
/// that the first missed or that the trigger skipped.
std::vector<int64_t> commands_missed_by_second(const take::CameraLedger& first,
                                               const take::CameraLedger& second) {
  std::vector<int64_t> commands;
  int64_t command = 0;
  for (int64_t pulse = 0; pulse < kPulses; ++pulse) {
    if (std::ranges::binary_search(first.missing, pulse)) continue;
    if (std::ranges::binary_search(second.missing, pulse)) commands.push_back(command);
    ++command;
  }
  return commands;
}

TEST_F(ActionStudioWithLoss, names_the_pulses_whose_command_did_not_reach_a_camera) {
  const take::Ledger ledger = record(4);
  expect_all_accounted_for(ledger);
  ASSERT_EQ(ledger.cameras.size(), 2U);
  const take::CameraLedger &cam01 = ledger.cameras[0], &cam02 = ledger.cameras[1];
  expect_unsensed_missing(cam01, ledger);
  const std::vector<int64_t> lost = commands_missed_by_second(cam01, cam02);
  // A busy camera rejects further commands as late.
  ASSERT_GE(lost.size(), 2U);
  EXPECT_TRUE(lost.size() == 2 || is_late_ || has_late_commands_) << testing::PrintToString(lost);
  if (lost.size() == 2) {
    EXPECT_NEAR(static_cast<double>(lost[1] - lost[0]), 12 - 7, 1)
        << "a late frame may be misnamed";
  }
  // Otherwise further pulses are skipped or not sensed, and the simulator counts commands.
  if (!is_late_ && !has_late_commands_) {
    EXPECT_EQ(ledger.sensed, kPulses - 1);
    EXPECT_THAT(ledger.unsensed, ElementsAre(20));
    EXPECT_THAT(cam02.missing, ElementsAre(7, 12, 20));
    // As with a cable, the next frame is suspect: the counter of the camera left out no number. So
    // are the frames after it, until a busy machine has delivered two in a row without delay.
    EXPECT_THAT(cam01.suspect, AllOf(Contains(21), Each(Ge(21))));
    EXPECT_THAT(cam02.suspect, AllOf(IsSupersetOf({8, 13, 21}), Each(Ge(8))));
    for (const take::CameraLedger* camera : {&cam01, &cam02}) {
      EXPECT_LT(camera->suspect.back(), kPulses - 1) << camera->name << ": later ones are certain";
    }
  }
  const std::string warning = " acknowledgements of action commands missing: cam01, cam02";
  EXPECT_TRUE(becomes_true([&] { return log().find(warning) != std::string::npos; }, within(60)))
      << log();
  EXPECT_TRUE(reaches("cap01", "trigger_acks_missing", 4));
  EXPECT_TRUE(value("cap01", "trigger_acks_rejected") == 0 ||
              log().find(io::text_of(io::ActionStatus::kLate)) != std::string::npos)
      << "a lost command is not rejected: " << log();
}

class ActionStudioWithoutPtp : public ActionStudio {
 protected:
  ActionStudioWithoutPtp() : ActionStudio("", {"--no-ptp"}) { is_scheduled_ = false; }
};

TEST_F(ActionStudioWithoutPtp, says_at_arming_why_commands_have_no_time_and_records_all_pulses) {
  const control::Answer armed = command(wire::CommandVerb::kArm, kPulses);
  ASSERT_TRUE(armed.done()) << text_of(armed) << log();
  EXPECT_THAT(text_of(armed),
              HasSubstr("unscheduled action commands: PTP is not locked on cam01, cam02"));
  ASSERT_TRUE(command(wire::CommandVerb::kStart).done()) << log();
  ASSERT_TRUE(becomes_idle()) << log();
  note_lateness(0);
  const take::Ledger ledger = take::load_ledger(take().ledger());
  expect_all_pulses(ledger);
}

}  // namespace
}  // namespace v3d::test
