// Scenario tests of a wall clock that is set on a capture PC while its daemon runs.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "set_clock.h"
#include "studio4.h"
#include "take/ledger/verify.h"

namespace v3d {
namespace {

using test::becomes_true;
using test::Studio4;
using test::within;
using testing::HasSubstr;

class ClockStudio4 : protected test::SetClockPreloaded, public Studio4 {
 protected:
  ClockStudio4() : Studio4({.rate = "10"}) {}

  void expect_complete_take_with_live_meshes() {
    const control::Answer stopped = command(wire::CommandVerb::kStop);
    ASSERT_TRUE(stopped.done()) << text_of(stopped) << log();
    const take::Verification verified = verify_take(take());
    EXPECT_TRUE(verified.whole()) << verified.ledger.verdict() << log();
    const auto recon = nlohmann::json::parse(stopped.replies.at("recon01").detail);
    EXPECT_GT(recon["meshes"], 0) << recon;
  }
};

TEST_F(ClockStudio4, records_a_complete_take_after_the_clock_was_set_back_by_an_hour) {
  set_clock(-3600);
  ASSERT_TRUE(reaches("cap01", "clock_steps", 1)) << log();
  EXPECT_THAT(log(), HasSubstr("the clock was set back by 3600.0 s"));
  arm_and_start(20);
  ASSERT_TRUE(becomes_idle()) << log();
  expect_complete_take_with_live_meshes();
}

TEST_F(ClockStudio4, loses_no_live_frame_when_the_clock_is_set_back_during_a_take) {
  arm_and_start(0);
  ASSERT_TRUE(reaches("cap01", "frames_written", 20)) << log();
  const double stale_before = value("recon01", "messages_stale");
  ASSERT_GE(stale_before, 0) << "recon01 sends no health";
  set_clock(-60);
  ASSERT_TRUE(reaches("cap01", "clock_steps", 1)) << log();
  EXPECT_TRUE(becomes_true(
      [&] {
        return client_->health(within(5))["cap01"].text.find("keeps the previous time") !=
               std::string::npos;
      },
      within(60)))
      << log();
  ASSERT_TRUE(reaches("cap01", "frames_written", value("cap01", "frames_written") + 80)) << log();
  EXPECT_EQ(value("recon01", "messages_stale"), stale_before);
  expect_complete_take_with_live_meshes();
}

/// cap02 has no sense line: it compares its clock with that of cap01.
class ClockStudioOfTwoNodes : protected test::SetClockPreloaded, public Studio4 {
 protected:
  ClockStudioOfTwoNodes() : Studio4({.rate = "10", .two_nodes = true}) {}

  void expect_certain_take(const std::string& name) {
    take_name_ = name;
    arm_and_start(0);
    ASSERT_TRUE(reaches("cap02", "frames_written", 60)) << log();
    const control::Answer stopped = command(wire::CommandVerb::kStop);
    ASSERT_TRUE(stopped.done()) << text_of(stopped) << log();
    for (const take::TakePaths& part : {take(), take_of_cap02()}) {
      const take::Verification found = verify_take(part);
      EXPECT_TRUE(found.whole()) << found.ledger.verdict() << log();
      EXPECT_EQ(found.ledger.cameras.size(), 2U);
      for (const auto& camera : found.ledger.cameras) {
        EXPECT_THAT(camera.suspect, testing::IsEmpty()) << camera.name;
      }
    }
  }
};

TEST_F(ClockStudioOfTwoNodes, suspects_no_frame_after_the_clocks_were_set_back_by_3_s) {
  expect_certain_take("before");
  set_clock(-3);
  for (const char* node : {"cap01", "cap02"}) {
    ASSERT_TRUE(reaches(node, "clock_steps", 1)) << log();
  }
  expect_certain_take("after");
}

}  // namespace
}  // namespace v3d
