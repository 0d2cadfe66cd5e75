#include "capture/cameras/camera_session.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>

#include "pilot_fixture.h"

namespace v3d {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;
using testing::HasSubstr;

TEST_F(CameraPilotTest, labels_every_frame_of_a_train) {
  make_ready();
  script_->start_train(50);
  play(seconds(3));
  ASSERT_EQ(frames_.size(), 50U);
  EXPECT_EQ(mislabelled(), 0);
  const Frame& last = frames_.back();
  EXPECT_EQ(last.camera, "cam07");
  EXPECT_EQ(last.label.camera_counter, 149U);
  EXPECT_EQ(last.sensor_size, (ImageSize{4, 2}));
  EXPECT_EQ(last.roi, (Rect{0, 0, 4, 2}));
  EXPECT_FALSE(last.mask);
  EXPECT_EQ(pilot_->status().frames, 50);
  EXPECT_EQ(pilot_->status().suspect, 0);
  EXPECT_EQ(pilot_->status().last_pulse, 49);
}

TEST_F(CameraPilotTest, throws_away_what_comes_before_it_is_armed_and_quiet) {
  script_->start_train(20);
  ASSERT_TRUE(reach(CameraState::kIdle));
  play(milliseconds(300));
  pilot_->arm(Script::kPeriod, false);
  const MonotonicInstant last_exposure = script_->exposure(19);
  ASSERT_TRUE(reach(CameraState::kReady));
  EXPECT_GE(script_->now, last_exposure + Script::kLatency + 2 * Script::kPeriod);
  EXPECT_TRUE(frames_.empty());
  script_->start_train(5);
  play(seconds(1));
  EXPECT_EQ(frames_.size(), 5U);
  EXPECT_EQ(mislabelled(), 0);
}

TEST_F(CameraPilotTest, is_not_ready_before_two_periods_have_passed_in_quiet) {
  ASSERT_TRUE(reach(CameraState::kIdle));
  play(seconds(5));
  const MonotonicInstant armed = script_->now;
  pilot_->arm(Script::kPeriod, false);
  EXPECT_EQ(pilot_->status().state, CameraState::kSettling);
  ASSERT_TRUE(reach(CameraState::kReady));
  EXPECT_GE(script_->now, armed + 2 * Script::kPeriod);
}

TEST_F(CameraPilotTest, waits_for_the_first_pulse_as_long_as_it_takes) {
  make_ready();
  play(std::chrono::minutes(10));
  EXPECT_EQ(pilot_->status().state, CameraState::kReady);
  EXPECT_EQ(script_->opened, 1);
}

TEST_F(CameraPilotTest, numbers_the_next_take_from_zero) {
  for (int take = 0; take < 3; ++take) {
    make_ready();
    frames_.clear();
    script_->start_train(10);
    play(seconds(1));
    pilot_->train_ended();
    pilot_->disarm();
    ASSERT_EQ(frames_.size(), 10U);
    EXPECT_EQ(frames_[0].label.pulse, 0);
    EXPECT_EQ(mislabelled(), 0);
    EXPECT_EQ(pilot_->status().suspect, 0);
  }
}

TEST_F(CameraPilotTest, keeps_the_numbers_when_the_first_frames_arrive_broken) {
  script_->damaged = {0, 1};
  make_ready();
  script_->start_train(10);
  play(seconds(1));
  ASSERT_EQ(frames_.size(), 8U);
  EXPECT_EQ(mislabelled(), 0);
  EXPECT_EQ(pilot_->status().suspect, 0);
}

TEST_F(CameraPilotTest, keeps_the_numbers_when_the_first_frame_of_the_second_take_leaves_no_trace) {
  make_ready();
  script_->start_train(10);
  play(seconds(1));
  make_ready();
  frames_.clear();
  script_->vanished = {0};
  script_->start_train(10);
  play(seconds(1));
  ASSERT_EQ(frames_.size(), 9U);
  EXPECT_EQ(frames_[0].label.pulse, 1);
  EXPECT_EQ(mislabelled(), 0);
  EXPECT_EQ(pilot_->status().suspect, 9) << "it may have been the last of the train before";
}

TEST_F(SensedCameraPilotTest, is_certain_when_the_first_frame_leaves_no_trace) {
  train_before();
  for (const std::set<int64_t>& lost : {std::set<int64_t>{0}, {0, 1, 2}, {0, 2}}) {
    script_->vanished = lost;
    train(20);
    EXPECT_EQ(frames_.size(), 20 - lost.size());
    EXPECT_EQ(mislabelled(), 0);
    EXPECT_EQ(pilot_->status().suspect, 0);
  }
}

TEST_F(SensedCameraPilotTest, is_certain_when_the_last_frame_of_the_train_before_left_no_trace) {
  train_before();
  script_->vanished = {19};
  train(20);
  EXPECT_EQ(frames_.size(), 19U);
  EXPECT_EQ(pilot_->status().suspect, 0);
  script_->vanished.clear();
  train(20);
  ASSERT_EQ(frames_.size(), 20U);
  EXPECT_EQ(mislabelled(), 0);
  EXPECT_EQ(pilot_->status().suspect, 0);
}

TEST_F(SensedCameraPilotTest, is_certain_of_the_very_first_train) {
  train(5);
  EXPECT_EQ(pulses(), (std::vector<int64_t>{0, 1, 2, 3, 4}));
  EXPECT_EQ(pilot_->status().suspect, 0);
}

TEST_F(SensedCameraPilotTest, suspects_a_very_first_train_whose_first_frame_left_no_trace) {
  script_->vanished = {0};
  train(20);
  EXPECT_EQ(frames_.size(), 19U);
  EXPECT_EQ(pilot_->status().suspect, 19);
}

TEST_F(SensedCameraPilotTest, suspects_a_train_whose_first_trigger_the_camera_missed) {
  train_before();
  script_->missed = {0};
  train(20);
  EXPECT_EQ(frames_.size(), 19U);
  EXPECT_EQ(pilot_->status().suspect, 19);
}

TEST_F(SensedCameraPilotTest, waits_with_a_first_frame_that_is_late_for_one_that_is_not) {
  train_before();
  script_->plugged = false;
  ASSERT_TRUE(reach(CameraState::kLost));
  script_->plugged = true;
  script_->first_is_late = Script::kPeriod;
  train(20);
  EXPECT_EQ(frames_.size(), 20U);
  EXPECT_EQ(mislabelled(), 0);
  EXPECT_EQ(pilot_->status().suspect, 0);
}

TEST_F(SensedCameraPilotTest, does_not_keep_the_frames_of_a_short_train_to_itself) {
  script_->first_is_late = 3 * Script::kPeriod;
  train(1);
  EXPECT_EQ(frames_.size(), 1U);
  EXPECT_EQ(pilot_->status().suspect, 1);
}

TEST_F(SensedCameraPilotTest,
       misses_a_camera_that_does_not_see_the_first_pulse_after_three_periods) {
  make_ready();
  script_->silent = true;
  script_->start_train(100);
  ASSERT_TRUE(reach(CameraState::kLost, seconds(1)));
  EXPECT_LE(script_->now, script_->exposure(3) + CameraSession::kMaxStep);
  EXPECT_EQ(pilot_->status().last_loss, "no frame for 3 pulses");
}

TEST_F(SensedCameraPilotTest, joins_a_train_late_when_it_was_lost_before_its_first_frame) {
  train_before();
  make_ready();
  frames_.clear();
  script_->silent = true;
  script_->start_train(200);
  play(seconds(2));
  script_->silent = false;
  play(seconds(4));
  EXPECT_GE(pilot_->status().losses, 1);
  EXPECT_GT(frames_.size(), 50U);
  EXPECT_EQ(mislabelled(), 0);
  EXPECT_EQ(pilot_->status().suspect, 0);
}

TEST_F(CameraPilotTest, is_not_confused_by_a_broken_last_frame_of_the_take_before) {
  script_->damaged = {9};
  make_ready();
  script_->start_train(10);
  play(seconds(1));
  make_ready();
  frames_.clear();
  script_->damaged.clear();
  script_->start_train(5);
  play(seconds(1));
  ASSERT_EQ(frames_.size(), 5U);
  EXPECT_EQ(mislabelled(), 0);
  EXPECT_EQ(pilot_->status().suspect, 0);
}

TEST_F(CameraPilotTest, is_lost_after_three_silent_periods_and_comes_back_by_itself) {
  make_ready();
  script_->start_train(1000);
  play(seconds(1));
  script_->vanished = {30, 31, 32, 33, 34, 35};
  ASSERT_TRUE(reach(CameraState::kLost, seconds(1)));
  EXPECT_EQ(script_->now, script_->exposure(29) + Script::kLatency + 3 * Script::kPeriod);
  EXPECT_EQ(pilot_->status().text, "no frame for 3 pulses after pulse 29");
  ASSERT_TRUE(reach(CameraState::kRunning, seconds(1)));
  EXPECT_EQ(pilot_->status().text, "");
  play(seconds(4));
  EXPECT_EQ(script_->opened, 1);
  EXPECT_EQ(pilot_->status().last_loss, "no frame for 3 pulses after pulse 29");
  EXPECT_EQ(mislabelled(), 0);
  EXPECT_EQ(frames_.back().label.pulse, static_cast<int64_t>(frames_.size()) - 1 + 6);
  EXPECT_EQ(pilot_->status().suspect, 0);
  EXPECT_EQ(pilot_->status().losses, 1);
}

TEST_F(CameraPilotTest, does_not_miss_frames_after_the_train_has_ended) {
  make_ready();
  script_->start_train(10);
  play(milliseconds(450));
  pilot_->train_ended();
  play(seconds(10));
  EXPECT_EQ(pilot_->status().losses, 0);
  EXPECT_EQ(pilot_->status().state, CameraState::kRunning);
  EXPECT_EQ(script_->opened, 1);
}

TEST_F(CameraPilotTest, numbers_frames_rightly_after_the_camera_was_opened_again) {
  for (const bool clock_begins_anew : {false, true}) {
    script_ = std::make_shared<Script>();
    CameraWorkerOptions options;
    options.now = [s = script_] { return s->now; };
    pilot_ = std::make_unique<CameraSession>(
        "cam07", [s = script_] { return std::make_unique<ScriptedCamera>(s); }, options);
    frames_.clear();
    make_ready();
    script_->start_train(1000);
    play(seconds(4));
    script_->plugged = false;
    ASSERT_TRUE(reach(CameraState::kLost));
    play(seconds(10));
    script_->plugged = true;
    script_->opening_takes = milliseconds(1500);
    script_->counter = 1;
    if (clock_begins_anew) script_->device_zero = -seconds(14);
    ASSERT_TRUE(reach(CameraState::kRunning));
    play(seconds(5));
    EXPECT_EQ(mislabelled(), 0) << clock_begins_anew;
    // Without its clock there is only the time of arrival, which takes eight frames to be believed.
    EXPECT_EQ(pilot_->status().suspect, clock_begins_anew ? 8 : 0);
    EXPECT_EQ(pilot_->status().losses, 1);
    EXPECT_GT(frames_.back().label.pulse, 450);
  }
}

TEST_F(CameraPilotTest, opens_a_camera_again_that_answers_but_stays_silent) {
  make_ready();
  script_->start_train(1000);
  play(seconds(2));
  script_->silent = true;
  play(milliseconds(900));
  EXPECT_EQ(script_->opened, 1);
  play(milliseconds(300));
  EXPECT_EQ(script_->opened, 2);
  script_->silent = false;
  play(seconds(5));
  EXPECT_EQ(pilot_->status().state, CameraState::kRunning);
  EXPECT_EQ(mislabelled(), 0);
  EXPECT_EQ(pilot_->status().losses, 1);
}

TEST_F(CameraPilotTest, tells_why_it_cannot_open_and_tries_again) {
  script_->plugged = false;
  play(seconds(5));
  EXPECT_EQ(pilot_->status().state, CameraState::kOpening);
  EXPECT_THAT(pilot_->status().text, HasSubstr("nothing answers"));
  script_->plugged = true;
  ASSERT_TRUE(reach(CameraState::kIdle, seconds(2)));
  EXPECT_EQ(pilot_->status().text, "");
  EXPECT_EQ(pilot_->status().size, (ImageSize{4, 2}));
}

TEST_F(CameraPilotTest, settles_again_when_it_was_lost_before_the_first_pulse) {
  make_ready();
  script_->plugged = false;
  ASSERT_TRUE(reach(CameraState::kLost));
  script_->plugged = true;
  ASSERT_TRUE(reach(CameraState::kReady));
  script_->start_train(5);
  play(seconds(1));
  EXPECT_EQ(frames_.size(), 5U);
  EXPECT_EQ(mislabelled(), 0);
}

TEST_F(CameraPilotTest, sums_the_statistics_of_all_the_times_it_was_opened) {
  make_ready();
  script_->damaged = {3};
  script_->start_train(1000);
  play(seconds(1));
  const auto before = pilot_->status().link;
  EXPECT_EQ(before.damaged, 1);
  script_->plugged = false;
  ASSERT_TRUE(reach(CameraState::kLost));
  script_->plugged = true;
  play(seconds(1));
  EXPECT_EQ(pilot_->status().link.damaged, 1);
  EXPECT_GT(pilot_->status().link.completed, before.completed);
}

}  // namespace
}  // namespace v3d
