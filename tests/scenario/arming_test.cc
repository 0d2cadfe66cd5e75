// Scenario tests of arming: takes that are aborted before their start, cameras that may be missing.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "studio4.h"

namespace v3d {
namespace {

using test::Studio4;
using test::within;
using testing::ElementsAre;
using testing::HasSubstr;

class StudioOfTwoNodes : public Studio4 {
 protected:
  StudioOfTwoNodes() : Studio4({.rate = "10", .two_nodes = true}) {}

  control::Answer arm_without(const std::vector<std::string>& cameras) {
    wire::CommandMessage arm;
    arm.verb = wire::CommandVerb::kArm;
    arm.take = take_name_;
    arm.allow_missing = cameras;
    return client_->command(arm, within(60));
  }
};

TEST_F(StudioOfTwoNodes, arms_the_name_of_an_aborted_take_again_after_another_take) {
  arm_and_start(10);
  ASSERT_TRUE(becomes_idle()) << log();
  ASSERT_TRUE(command(wire::CommandVerb::kStop).done()) << log();
  take_name_ = "kendo-08";
  const control::Answer armed = command(wire::CommandVerb::kArm);
  ASSERT_TRUE(armed.done()) << text_of(armed) << log();
  client_->health(within(5));  // of the armed nodes
  EXPECT_EQ(value("cap02", "pulses_commanded"), 0);
  EXPECT_EQ(value("cap02", "frames_missing"), 0);
  ASSERT_TRUE(command(wire::CommandVerb::kAbort).done()) << log();
  const control::Answer again = command(wire::CommandVerb::kArm);
  EXPECT_TRUE(again.done()) << text_of(again) << log();
  EXPECT_TRUE(command(wire::CommandVerb::kAbort).done()) << log();
}

TEST_F(StudioOfTwoNodes, waits_at_start_until_every_node_has_closed_the_take) {
  run_v3dctl({"arm", take_name_, "--pulses", "10"}, 0);
  run_v3dctl({"start", "--wait", "--timeout", "50"}, 0);
  for (const take::TakePaths& part : {take(), take_of_cap02()}) {
    EXPECT_EQ(load_take_info(part).state, take::TakeState::kComplete) << part.folder;
  }
}

TEST_F(StudioOfTwoNodes, records_cameras_that_may_be_missing_and_work) {
  const control::Answer armed = arm_without({"cam03", "cam04"});
  ASSERT_TRUE(armed.done()) << text_of(armed) << log();
  EXPECT_THAT(text_of(armed), HasSubstr("cap02: 2 cameras streaming and quiet"));
  EXPECT_THAT(load_take_info(take_of_cap02()).cameras, ElementsAre("cam03", "cam04"));
}

TEST_F(StudioOfTwoNodes, records_without_a_camera_that_may_be_missing_and_has_no_plates) {
  for (const auto& file : std::filesystem::directory_iterator(studio_.storage.background)) {
    if (file.path().filename().string().starts_with("cam02")) std::filesystem::remove(file.path());
  }
  const control::Answer armed = arm_without({"cam02"});
  ASSERT_TRUE(armed.done()) << text_of(armed) << log();
  EXPECT_THAT(load_take_info(take()).cameras, ElementsAre("cam01"));
  // Its frames, which nobody takes, do not make the others late.
  ASSERT_TRUE(command(wire::CommandVerb::kStart).done()) << log();
  ASSERT_TRUE(reaches("cap01", "frames_written", 40)) << log();
  // A busy machine may delay some pulses. With a full queue of cam02, all but the first few are
  // late.
  const double not_live = value("cap01", "pulses_not_live");
  EXPECT_GE(not_live, 0) << "cap01 sends no health";
  EXPECT_LT(not_live, 20) << log();
  EXPECT_TRUE(reaches("cap01", "frames_published", 20)) << log();
  EXPECT_EQ(value("cap01", "cam02.frames_missing"), 0) << "the take goes without it";
  EXPECT_TRUE(command(wire::CommandVerb::kStop).done()) << log();
}

TEST_F(StudioOfTwoNodes, is_not_armed_when_all_cameras_may_be_missing) {
  const control::Answer armed = arm_without({"cam01", "cam02", "cam03", "cam04"});
  EXPECT_FALSE(armed.done());
  EXPECT_THAT(text_of(armed), HasSubstr("all cameras may be missing; expected one at least"));
}

}  // namespace
}  // namespace v3d
