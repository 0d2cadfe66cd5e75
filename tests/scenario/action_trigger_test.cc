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

Studio4Options two_cameras(const std::string& faults, const std::vector<std::string>& more) {
  Studio4Options options{.cameras = 2, .faults = faults, .simulator = {"--trigger", "action"}};
  options.simulator.insert(options.simulator.end(), more.begin(), more.end());
  return options;
}

class ActionStudio : public Studio4 {
 protected:
  explicit ActionStudio(const std::string& faults = {}, const std::vector<std::string>& more = {})
      : Studio4(two_cameras(faults, more)) {}

  /// Records a take of kPulses and returns the ledger of its node.
  take::Ledger record() {
    arm_and_start(kPulses);
    EXPECT_TRUE(becomes_idle()) << log();
    return take::load_ledger(take().ledger());
  }
};

TEST_F(ActionStudio, records_every_pulse_that_is_commanded_without_a_cable) {
  const take::Ledger ledger = record();
  EXPECT_EQ(ledger.commanded, kPulses);
  EXPECT_EQ(ledger.sensed, kPulses);
  EXPECT_THAT(ledger.unsensed, IsEmpty());
  ASSERT_EQ(ledger.cameras.size(), 2U);
  for (const take::CameraLedger& camera : ledger.cameras) {
    EXPECT_EQ(camera.written, kPulses) << camera.name;
    EXPECT_THAT(camera.missing, IsEmpty()) << camera.name;
    EXPECT_THAT(camera.suspect, IsEmpty()) << camera.name;
  }
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
  EXPECT_EQ(ledger.commanded, kPulses);
  EXPECT_EQ(ledger.sensed, kPulses - 1);
  EXPECT_THAT(ledger.unsensed, ElementsAre(20)) << "no camera acknowledged it";
  ASSERT_EQ(ledger.cameras.size(), 2U);
  EXPECT_THAT(ledger.cameras[0].missing, ElementsAre(20));
  EXPECT_THAT(ledger.cameras[1].missing, ElementsAre(7, 12, 20));
  // As with a cable, the next frame is suspect: the counter of the camera left out no number. A
  // busy machine may deliver a frame late, which makes it suspect, too.
  EXPECT_THAT(ledger.cameras[0].suspect, AllOf(Contains(21), IsSubsetOf({21, 22, 23})));
  EXPECT_THAT(ledger.cameras[1].suspect,
              AllOf(IsSupersetOf({8, 13, 21}), IsSubsetOf({8, 9, 10, 13, 14, 15, 21, 22, 23})));
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
  const take::Ledger ledger = take::load_ledger(take().ledger());
  EXPECT_EQ(ledger.sensed, kPulses);
  EXPECT_TRUE(ledger.complete()) << ledger.verdict();
}

}  // namespace
}  // namespace v3d::test
