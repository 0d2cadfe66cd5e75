// Scenario tests of a wall clock that is set on a capture PC while its daemon runs.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdlib>
#include <nlohmann/json.hpp>

#include "studio4.h"
#include "support/temporary_folder.h"
#include "take/ledger/verify.h"

namespace v3d {
namespace {

using test::becomes_true;
using test::Studio4;
using test::within;
using testing::HasSubstr;

/// Sets the environment that preloads v3d_set_clock into daemons started during its lifetime.
struct SetClockPreloaded {
  SetClockPreloaded() {
    setenv("LD_PRELOAD", V3D_SET_CLOCK_LIBRARY, 1);
    setenv("V3D_SET_CLOCK", control().c_str(), 1);
    setenv("V3D_SET_CLOCK_OF", "v3d-captured", 1);
  }
  ~SetClockPreloaded() {
    for (const char* name : {"LD_PRELOAD", "V3D_SET_CLOCK", "V3D_SET_CLOCK_OF"}) unsetenv(name);
  }
  std::filesystem::path control() const { return folder_ / "seconds"; }

 private:
  const test::TemporaryFolder folder_;
};

class ClockStudio4 : private SetClockPreloaded, public Studio4 {
 protected:
  /// Sets the wall clock of cap01 to `seconds` after the right time.
  void set_clock(int seconds) { test::write_text(control(), std::to_string(seconds)); }

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
  set_clock(-60);
  ASSERT_TRUE(reaches("cap01", "clock_steps", 1)) << log();
  EXPECT_THAT(client_->health(within(5)).at("cap01").text, HasSubstr("keeps the previous time"));
  ASSERT_TRUE(reaches("cap01", "frames_written", value("cap01", "frames_written") + 80)) << log();
  EXPECT_EQ(value("recon01", "messages_stale"), stale_before);
  expect_complete_take_with_live_meshes();
}

}  // namespace
}  // namespace v3d
