// Cameras that are triggered by action commands, with the real daemons.
#include <gmock/gmock.h>

#include "studio4.h"
#include "take/ledger/ledger.h"
#include "take/ledger/verify.h"

namespace v3d::test {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;

constexpr int kPulses = 30;

Studio4Options two_cameras(const std::string& faults) {
  return {.cameras = 2, .faults = faults, .simulator = {"--trigger", "action"}};
}

class ActionStudio : public Studio4 {
 protected:
  explicit ActionStudio(const std::string& faults = {}) : Studio4(two_cameras(faults)) {}

  /// Records a take of kPulses and returns the ledger of its node.
  take::Ledger record() {
    arm_and_start(kPulses);
    EXPECT_TRUE(becomes_idle()) << log();
    return take::load_ledger(take().ledger("cap01"));
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
  EXPECT_THAT(log(), HasSubstr("acknowledgements of action commands missing: "));
}

}  // namespace
}  // namespace v3d::test
