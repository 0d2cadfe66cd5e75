// Tests of CameraSession on a host that stalls: its thread does not run, and frames wait for it.
#include <gtest/gtest.h>

#include "pilot_fixture.h"

namespace v3d::capture {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

TEST_F(CameraSessionTest, keeps_a_camera_open_and_all_its_frames_while_the_host_stalls) {
  make_ready();
  script_->start_train(1000);
  play(seconds(1));
  script_->host_stalls = seconds(3);
  play(seconds(6));
  ASSERT_GT(frames_.size(), 120U);
  EXPECT_EQ(frames_.back().label.pulse, std::ssize(frames_) - 1);
  EXPECT_EQ(mislabelled(), 0);
  EXPECT_EQ(session_->status().suspect, 0);
  EXPECT_EQ(session_->status().losses, 0);
  EXPECT_EQ(script_->opened, 1);
}

TEST_F(CameraSessionTest, does_not_take_a_stall_of_the_host_for_a_quiet_camera) {
  script_->start_train(1000);
  ASSERT_TRUE(reach(CameraState::kIdle));
  session_->arm(Script::kPeriod, false);
  script_->host_stalls = seconds(1);
  play(seconds(2));
  EXPECT_EQ(session_->status().state, CameraState::kSettling);
}

TEST_F(SensedCameraSessionTest, is_certain_if_the_host_stalls_at_the_first_pulses) {
  train_before();
  for (const int stalled : {2, 9, 20}) {
    make_ready();
    frames_.clear();
    script_->start_train(40);
    script_->host_stalls = stalled * Script::kPeriod;
    play(41 * Script::kPeriod);
    session_->train_ended();
    play(seconds(1));
    EXPECT_EQ(frames_.size(), 40U);
    EXPECT_EQ(mislabelled(), 0);
    EXPECT_EQ(session_->status().suspect, 0) << stalled << " periods";
  }
}

TEST_F(SensedCameraSessionTest, is_certain_at_a_low_rate_if_the_first_frame_vanishes) {
  for (const Duration period : {milliseconds(250), milliseconds(1000)}) {
    script_->period = period;
    script_->vanished = {};
    train_before();
    script_->vanished = {0};
    train(20);
    EXPECT_EQ(frames_.size(), 19U);
    EXPECT_EQ(mislabelled(), 0);
    EXPECT_EQ(session_->status().suspect, 0) << period.count() << " ns";
  }
}

}  // namespace
}  // namespace v3d::capture
