// CameraSession at the start of a train: long latencies, pulses with wrong times, late cameras.

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <algorithm>

#include "capture/cameras/camera_session.h"
#include "pilot_fixture.h"

namespace v3d::capture {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

class StartingCameraSessionTest : public SensedCameraSessionTest {
 protected:
  int64_t wrong_and_certain() const {
    return std::ranges::count_if(frames_, [](const Frame& f) {
      return !f.label.suspect && f.label.pulse % 256 != f.image.bytes[0];
    });
  }
};

/// At 125 Hz frames arrive 9 ms after their pulse, later than the next one.
class FastCameraSessionTest : public StartingCameraSessionTest {
 protected:
  FastCameraSessionTest() { script_->period = milliseconds(8); }
};

TEST_F(FastCameraSessionTest,
       is_certain_of_the_very_first_train_if_the_camera_counts_from_a_known_value) {
  script_->first_counter = script_->counter;
  train(20);
  ASSERT_EQ(frames_.size(), 20U);
  EXPECT_EQ(mislabelled(), 0);
  EXPECT_EQ(session_->status().suspect, 0);
  train(20);
  EXPECT_EQ(mislabelled(), 0);
  EXPECT_EQ(session_->status().suspect, 0);
}

TEST_F(FastCameraSessionTest, counts_damaged_frames_of_the_very_first_train) {
  script_->first_counter = script_->counter;
  script_->damaged = {0, 1};
  train(20);
  ASSERT_EQ(frames_.size(), 18U);
  EXPECT_EQ(mislabelled(), 0);
  EXPECT_EQ(session_->status().suspect, 0);
}

TEST_F(FastCameraSessionTest,
       suspects_the_very_first_train_if_the_camera_counts_from_another_value) {
  for (const int64_t other : {-1, 1}) {
    session_->close();
    script_->first_counter = script_->counter + static_cast<uint64_t>(other);
    train(20);
    EXPECT_EQ(session_->status().suspect, std::ssize(frames_)) << other;
  }
}

TEST_F(FastCameraSessionTest, suspects_the_very_first_train_if_its_first_frame_vanishes) {
  script_->first_counter = script_->counter;
  script_->vanished = {0};
  train(20);
  EXPECT_EQ(frames_.size(), 19U);
  EXPECT_EQ(session_->status().suspect, 19);
}

/// It counts from the known value, too, but from a pulse within the train.
TEST_F(FastCameraSessionTest,
       does_not_number_from_zero_if_the_camera_is_opened_again_in_the_train) {
  script_->first_counter = script_->counter;
  make_ready();
  frames_.clear();
  script_->silent = true;
  script_->start_train(400);
  play(milliseconds(1500));
  script_->counter = *script_->first_counter;
  script_->silent = false;
  play(milliseconds(1500));
  EXPECT_GE(script_->opened, 2);
  EXPECT_GT(frames_.size(), 20U);
  EXPECT_EQ(wrong_and_certain(), 0);
}

TEST_F(StartingCameraSessionTest,
       suspects_a_train_whose_pulses_seem_to_be_later_than_their_frames) {
  for (const int ms : {15, 30, 45, 60, 90}) {
    time_error_ = milliseconds(ms);
    train(50);
    ASSERT_EQ(frames_.size(), 50U);
    EXPECT_EQ(session_->status().suspect, 50) << ms;
  }
}

class LateCameraSessionTest : public SensedCameraSessionTest {
 protected:
  /// The camera is lost after it was ready, and is open again a second after pulse 0.
  void miss_the_first_second() {
    make_ready();
    frames_.clear();
    script_->plugged = false;
    ASSERT_TRUE(reach(CameraState::kLost));
    script_->start_train(200);
    play(seconds(1));
    script_->plugged = true;
    play(seconds(4));
    EXPECT_GT(frames_.size(), 50U);
    EXPECT_EQ(session_->status().state, CameraState::kRunning);
    EXPECT_EQ(session_->status().losses, 1);
  }
};

TEST_F(LateCameraSessionTest, joins_a_train_that_began_while_a_ready_camera_was_lost) {
  train_before();
  miss_the_first_second();
  EXPECT_EQ(mislabelled(), 0);
  EXPECT_EQ(session_->status().suspect, 0);
}

TEST_F(LateCameraSessionTest, suspects_all_frames_of_a_late_camera_if_no_time_of_a_pulse_is_known) {
  train_before();
  reports_are_timed_ = false;
  miss_the_first_second();
  EXPECT_EQ(session_->status().suspect, std::ssize(frames_));
}

TEST_F(LateCameraSessionTest, suspects_all_frames_of_a_late_camera_if_no_pulses_are_reported) {
  sensed_ = false;
  miss_the_first_second();
  EXPECT_EQ(session_->status().suspect, std::ssize(frames_));
}

TEST_F(LateCameraSessionTest, delivers_no_frame_of_a_camera_that_was_not_ready_before_the_train) {
  script_->plugged = false;
  session_->arm(script_->period, sensed_);
  script_->start_train(200);
  play(seconds(1));
  script_->plugged = true;
  play(seconds(4));
  EXPECT_TRUE(frames_.empty());
}

RC_GTEST_FIXTURE_PROP(StartingCameraSessionTest,
                      is_never_certain_of_a_wrong_number_however_wrong_the_times_of_pulses_are,
                      ()) {
  time_error_ = std::chrono::microseconds(*rc::gen::inRange(-120'000, 120'001));
  report_delay_ = milliseconds(*rc::gen::inRange(0, 400));
  if (*rc::gen::arbitrary<bool>()) train(16);
  if (*rc::gen::arbitrary<bool>()) {
    time_error_ = std::chrono::microseconds(*rc::gen::inRange(-120'000, 120'001));
  }
  train(40);
  RC_ASSERT(wrong_and_certain() == 0);
}

}  // namespace
}  // namespace v3d::capture
