// Trains of an instrument without a sense line: only the time of the start command is reported.
#include <gtest/gtest.h>

#include "pilot_fixture.h"

namespace v3d::capture {
namespace {

using std::chrono::milliseconds;

class CommandedTrainTest : public CameraSessionTest {
 protected:
  /// `delay`: from the command to pulse 0.
  void train(int64_t pulses, Duration delay) {
    session_->disarm();
    ASSERT_TRUE(reach(CameraState::kIdle));
    session_->arm(script_->period, true);
    ASSERT_TRUE(reach(CameraState::kReady));
    frames_.clear();
    script_->start_train(pulses);
    session_->pulse_at({.pulse = 0, .at = script_->exposure(0) - delay, .may_be_early = true});
    play((pulses + 1) * script_->period);
    session_->train_ended();
    play(std::chrono::seconds(1));
  }
};

TEST_F(CommandedTrainTest, is_certain_however_long_the_instrument_needs_for_the_command) {
  for (const int delay : {1, 45, 20, 30, 100, 1}) {
    train(20, milliseconds(delay));
    EXPECT_EQ(frames_.size(), 20U);
    EXPECT_EQ(mislabelled(), 0) << delay;
    EXPECT_EQ(session_->status().suspect, 0) << delay;
  }
}

TEST_F(CommandedTrainTest, is_not_certain_if_the_first_frame_vanishes_and_the_command_was_slow) {
  train(20, milliseconds(1));
  script_->vanished = {0};
  train(20, milliseconds(45));
  EXPECT_EQ(frames_.size(), 19U);
  EXPECT_EQ(mislabelled(), 0);
  EXPECT_EQ(session_->status().suspect, 19);
}

}  // namespace
}  // namespace v3d::capture
