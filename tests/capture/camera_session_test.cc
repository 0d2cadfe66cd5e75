#include "capture/cameras/camera_session.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>

#include "pilot_fixture.h"

namespace v3d::capture {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;
using testing::HasSubstr;

TEST_F(CameraSessionTest, labels_every_frame_of_a_train) {
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
  EXPECT_EQ(session_->status().frames, 50);
  EXPECT_EQ(session_->status().suspect, 0);
  EXPECT_EQ(session_->status().last_pulse, 49);
}

TEST_F(CameraSessionTest, drops_frames_before_it_is_armed_and_quiet) {
  script_->start_train(20);
  ASSERT_TRUE(reach(CameraState::kIdle));
  play(milliseconds(300));
  session_->arm(Script::kPeriod, false);
  const MonotonicInstant last_exposure = script_->exposure(19);
  ASSERT_TRUE(reach(CameraState::kReady));
  EXPECT_GE(script_->now, last_exposure + Script::kLatency + 2 * Script::kPeriod);
  EXPECT_TRUE(frames_.empty());
  script_->start_train(5);
  play(seconds(1));
  EXPECT_EQ(frames_.size(), 5U);
  EXPECT_EQ(mislabelled(), 0);
}

TEST_F(CameraSessionTest, is_ready_only_after_two_quiet_periods) {
  ASSERT_TRUE(reach(CameraState::kIdle));
  play(seconds(5));
  const MonotonicInstant armed = script_->now;
  session_->arm(Script::kPeriod, false);
  EXPECT_EQ(session_->status().state, CameraState::kSettling);
  ASSERT_TRUE(reach(CameraState::kReady));
  EXPECT_GE(script_->now, armed + 2 * Script::kPeriod);
}

TEST_F(CameraSessionTest, opens_a_camera_again_that_cannot_follow_the_pulses_of_an_order) {
  make_ready();
  make_ready();
  EXPECT_EQ(script_->opened, 1);
  script_->shortest_period = Script::kPeriod + std::chrono::milliseconds(1);
  make_ready();
  EXPECT_EQ(script_->opened, 2);
  EXPECT_EQ(session_->status().losses, 0) << "it is not lost";
  script_->start_train(3);
  play(std::chrono::seconds(1));
  EXPECT_EQ(frames_.size(), 3U);
  EXPECT_EQ(mislabelled(), 0);
}

TEST_F(CameraSessionTest, waits_for_the_first_pulse_without_a_timeout) {
  make_ready();
  play(std::chrono::minutes(10));
  EXPECT_EQ(session_->status().state, CameraState::kReady);
  EXPECT_EQ(script_->opened, 1);
}

TEST_F(CameraSessionTest, numbers_the_next_take_from_zero) {
  for (int take = 0; take < 3; ++take) {
    make_ready();
    frames_.clear();
    script_->start_train(10);
    play(seconds(1));
    session_->train_ended();
    session_->disarm();
    ASSERT_EQ(frames_.size(), 10U);
    EXPECT_EQ(frames_[0].label.pulse, 0);
    EXPECT_EQ(mislabelled(), 0);
    EXPECT_EQ(session_->status().suspect, 0);
  }
}

TEST_F(CameraSessionTest, labels_frames_correctly_if_the_first_ones_are_damaged) {
  script_->damaged = {0, 1};
  make_ready();
  script_->start_train(10);
  play(seconds(1));
  ASSERT_EQ(frames_.size(), 8U);
  EXPECT_EQ(mislabelled(), 0);
  EXPECT_EQ(session_->status().suspect, 0);
}

TEST_F(CameraSessionTest, labels_frames_correctly_if_the_first_one_of_the_second_take_vanishes) {
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
  EXPECT_EQ(session_->status().suspect, 9) << "the lost frame may belong to the previous train";
}

TEST_F(SensedCameraSessionTest, is_certain_if_the_first_frame_vanishes) {
  train_before();
  for (const std::set<int64_t>& lost : {std::set<int64_t>{0}, {0, 1, 2}, {0, 2}}) {
    script_->vanished = lost;
    train(20);
    EXPECT_EQ(frames_.size(), 20 - lost.size());
    EXPECT_EQ(mislabelled(), 0);
    EXPECT_EQ(session_->status().suspect, 0);
  }
}

TEST_F(SensedCameraSessionTest, is_certain_if_the_last_frame_of_the_previous_train_vanished) {
  train_before();
  script_->vanished = {19};
  train(20);
  EXPECT_EQ(frames_.size(), 19U);
  EXPECT_EQ(session_->status().suspect, 0);
  script_->vanished.clear();
  train(20);
  ASSERT_EQ(frames_.size(), 20U);
  EXPECT_EQ(mislabelled(), 0);
  EXPECT_EQ(session_->status().suspect, 0);
}

TEST_F(SensedCameraSessionTest, is_certain_of_the_very_first_train) {
  train(5);
  EXPECT_EQ(pulses(), (std::vector<int64_t>{0, 1, 2, 3, 4}));
  EXPECT_EQ(session_->status().suspect, 0);
}

TEST_F(SensedCameraSessionTest, is_certain_however_late_the_pulses_are_reported) {
  for (const bool is_timed : {true, false}) {
    for (const int periods : {0, 1, 3, 5, 7, 9, 12}) {
      reports_are_timed_ = is_timed;
      report_delay_ = periods * Script::kPeriod;
      train(30);
      EXPECT_EQ(frames_.size(), 30U);
      EXPECT_EQ(mislabelled(), 0) << periods;
      EXPECT_EQ(session_->status().suspect, 0) << periods;
    }
  }
}

TEST_F(SensedCameraSessionTest, suspects_the_very_first_train_if_its_first_frame_vanishes) {
  script_->vanished = {0};
  train(20);
  EXPECT_EQ(frames_.size(), 19U);
  EXPECT_EQ(session_->status().suspect, 19);
}

TEST_F(SensedCameraSessionTest, suspects_a_train_whose_first_trigger_the_camera_missed) {
  train_before();
  script_->missed = {0};
  train(20);
  EXPECT_EQ(frames_.size(), 19U);
  EXPECT_EQ(session_->status().suspect, 19);
}

TEST_F(SensedCameraSessionTest, holds_a_late_first_frame_until_one_is_on_time) {
  train_before();
  script_->plugged = false;
  ASSERT_TRUE(reach(CameraState::kLost));
  script_->plugged = true;
  script_->first_is_late = Script::kPeriod;
  train(20);
  EXPECT_EQ(frames_.size(), 20U);
  EXPECT_EQ(mislabelled(), 0);
  EXPECT_EQ(session_->status().suspect, 0);
}

TEST_F(SensedCameraSessionTest, delivers_the_held_frames_of_a_short_train) {
  script_->first_is_late = 3 * Script::kPeriod;
  train(1);
  EXPECT_EQ(frames_.size(), 1U);
  EXPECT_EQ(session_->status().suspect, 1);
}

TEST_F(SensedCameraSessionTest, takes_an_exposure_before_the_pulses_for_no_pulse) {
  for (const int ms : {150, 500, 10'000, 10'013, 60'000}) {
    for (const bool is_timed : {true, false}) {
      make_ready();
      frames_.clear();
      reports_are_timed_ = is_timed;
      script_->stray = script_->now;
      play(milliseconds(ms));
      EXPECT_EQ(session_->status().state, CameraState::kReady) << ms;
      script_->start_train(50);
      play(51 * Script::kPeriod);
      session_->train_ended();
      play(seconds(1));
      ASSERT_EQ(frames_.size(), 51U) << ms;
      // The frame of pulse 0 comes first: readers take the first frame of a pulse.
      const Frame& stray = frames_[is_timed ? 1 : 0];
      EXPECT_EQ(stray.image.bytes[0], Script::kStrayContent);
      EXPECT_EQ(stray.label.pulse, 0);
      EXPECT_TRUE(stray.label.suspect);
      EXPECT_EQ(session_->status().suspect, is_timed ? 1 : 51) << ms;
      EXPECT_TRUE(!is_timed || mislabelled() == 1) << "only the stray, " << ms << " ms before";
    }
  }
  EXPECT_EQ(session_->status().losses, 0);
  EXPECT_EQ(script_->opened, 1);
}

TEST_F(SensedCameraSessionTest, takes_many_exposures_before_the_pulses_for_no_pulse) {
  make_ready();
  for (int i = 0; i < 20; ++i) {
    script_->stray = script_->now;
    play(seconds(1));
    ASSERT_EQ(session_->status().state, CameraState::kReady) << i;
  }
  script_->start_train(50);
  play(51 * Script::kPeriod);
  session_->train_ended();
  play(seconds(1));
  ASSERT_GE(frames_.size(), 50U);
  EXPECT_EQ(frames_[0].image.bytes[0], 0);
  const auto strays = static_cast<int64_t>(frames_.size()) - 50;
  EXPECT_LE(strays, 2 * static_cast<int64_t>(kStartFrames)) << "the last ones";
  EXPECT_EQ(mislabelled(), strays);
  EXPECT_EQ(session_->status().suspect, strays);
  EXPECT_EQ(session_->status().losses, 0);
  EXPECT_EQ(script_->opened, 1);
}

TEST_F(SensedCameraSessionTest,
       delivers_an_exposure_before_the_pulses_of_a_camera_that_misses_all) {
  make_ready();
  script_->stray = script_->now;
  play(seconds(1));
  script_->silent = true;
  script_->start_train(5);
  play(seconds(1));
  session_->train_ended();
  play(seconds(1));
  ASSERT_EQ(frames_.size(), 1U);
  EXPECT_TRUE(frames_[0].label.suspect);
}

TEST_F(SensedCameraSessionTest, settles_again_after_an_exposure_without_a_pulse_and_a_loss) {
  train_before();
  make_ready();
  frames_.clear();
  script_->stray = script_->now;
  play(seconds(1));
  script_->plugged = false;
  ASSERT_TRUE(reach(CameraState::kLost));
  script_->plugged = true;
  ASSERT_TRUE(reach(CameraState::kReady));
  script_->start_train(5);
  play(seconds(1));
  ASSERT_EQ(frames_.size(), 6U);
  EXPECT_TRUE(frames_[1].label.suspect) << "after the frame of pulse 0";
  EXPECT_EQ(mislabelled(), 1) << "the stray";
  EXPECT_EQ(session_->status().suspect, 1);
}

TEST_F(SensedCameraSessionTest, reports_no_loss_after_a_train_that_ends_before_its_first_frame) {
  make_ready();
  script_->start_train(1);
  play(milliseconds(5));
  session_->train_ended();
  play(seconds(2));
  EXPECT_EQ(pulses(), (std::vector<int64_t>{0}));
  EXPECT_EQ(session_->status().suspect, 0);
  EXPECT_EQ(session_->status().losses, 0);
  EXPECT_EQ(script_->opened, 1);
}

TEST_F(SensedCameraSessionTest, reports_no_loss_of_a_free_running_camera_after_the_train) {
  script_->free_running = true;
  make_ready();
  script_->start_train(10);
  play(milliseconds(340));  // the frame of pulse 9 has not arrived
  session_->train_ended();
  ASSERT_EQ(frames_.size(), 9U);
  play(seconds(2));
  EXPECT_EQ(frames_.size(), 10U);
  EXPECT_EQ(session_->status().losses, 0);
  EXPECT_EQ(script_->opened, 1);
  script_->silent = true;
  make_ready();
  script_->silent = false;
  script_->start_train(100);
  play(seconds(1));
  script_->silent = true;
  EXPECT_TRUE(reach(CameraState::kLost, seconds(1))) << "in the next train it is";
}

TEST_F(SensedCameraSessionTest, reports_a_camera_lost_three_periods_after_a_missed_first_pulse) {
  make_ready();
  script_->silent = true;
  script_->start_train(100);
  ASSERT_TRUE(reach(CameraState::kLost, seconds(1)));
  EXPECT_LE(script_->now, script_->exposure(3) + CameraSession::kMaxStep);
  EXPECT_EQ(session_->status().last_loss, "no frame for 3 pulses");
}

TEST_F(SensedCameraSessionTest, joins_a_train_late_after_a_loss_before_its_first_frame) {
  train_before();
  make_ready();
  frames_.clear();
  script_->silent = true;
  script_->start_train(200);
  play(seconds(2));
  script_->silent = false;
  play(seconds(4));
  EXPECT_GE(session_->status().losses, 1);
  EXPECT_GT(frames_.size(), 50U);
  EXPECT_EQ(mislabelled(), 0);
  EXPECT_EQ(session_->status().suspect, 0);
}

TEST_F(CameraSessionTest, ignores_a_damaged_last_frame_of_the_previous_take) {
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
  EXPECT_EQ(session_->status().suspect, 0);
}

TEST_F(CameraSessionTest, is_lost_after_three_silent_periods_and_recovers) {
  make_ready();
  script_->start_train(1000);
  play(seconds(1));
  script_->vanished = {30, 31, 32, 33, 34, 35};
  ASSERT_TRUE(reach(CameraState::kLost, seconds(1)));
  EXPECT_EQ(script_->now, script_->exposure(29) + Script::kLatency + 3 * Script::kPeriod);
  EXPECT_EQ(session_->status().text, "no frame for 3 pulses after pulse 29");
  ASSERT_TRUE(reach(CameraState::kRunning, seconds(1)));
  EXPECT_EQ(session_->status().text, "");
  play(seconds(4));
  EXPECT_EQ(script_->opened, 1);
  EXPECT_EQ(session_->status().last_loss, "no frame for 3 pulses after pulse 29");
  EXPECT_EQ(mislabelled(), 0);
  EXPECT_EQ(frames_.back().label.pulse, static_cast<int64_t>(frames_.size()) - 1 + 6);
  EXPECT_EQ(session_->status().suspect, 0);
  EXPECT_EQ(session_->status().losses, 1);
}

TEST_F(CameraSessionTest, reports_no_loss_after_the_end_of_the_train) {
  make_ready();
  script_->start_train(10);
  play(milliseconds(450));
  session_->train_ended();
  play(seconds(10));
  EXPECT_EQ(session_->status().losses, 0);
  EXPECT_EQ(session_->status().state, CameraState::kRunning);
  EXPECT_EQ(script_->opened, 1);
}

TEST_F(CameraSessionTest, labels_frames_correctly_after_the_camera_is_reopened) {
  for (const bool clock_restarts : {false, true}) {
    script_ = std::make_shared<Script>();
    CameraWorkerOptions options;
    options.now = [s = script_] { return s->now; };
    session_ = std::make_unique<CameraSession>(
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
    if (clock_restarts) script_->device_zero = -seconds(14);
    ASSERT_TRUE(reach(CameraState::kRunning));
    play(seconds(5));
    EXPECT_EQ(mislabelled(), 0) << clock_restarts;
    // After a restart of the clock only the arrival remains, which needs eight confirmations.
    EXPECT_EQ(session_->status().suspect, clock_restarts ? 8 : 0);
    EXPECT_EQ(session_->status().losses, 1);
    EXPECT_GT(frames_.back().label.pulse, 450);
  }
}

TEST_F(CameraSessionTest, reopens_a_camera_that_answers_but_stays_silent) {
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
  EXPECT_EQ(session_->status().state, CameraState::kRunning);
  EXPECT_EQ(mislabelled(), 0);
  EXPECT_EQ(session_->status().losses, 1);
}

TEST_F(CameraSessionTest, reports_why_it_cannot_open_and_retries) {
  script_->plugged = false;
  play(seconds(5));
  EXPECT_EQ(session_->status().state, CameraState::kOpening);
  EXPECT_THAT(session_->status().text, HasSubstr("no answer"));
  script_->plugged = true;
  ASSERT_TRUE(reach(CameraState::kIdle, seconds(2)));
  EXPECT_EQ(session_->status().text, "");
  EXPECT_EQ(session_->status().size, (ImageSize{4, 2}));
}

TEST_F(CameraSessionTest, is_idle_again_when_it_is_plugged_in_between_takes) {
  ASSERT_TRUE(reach(CameraState::kIdle));
  script_->plugged = false;
  ASSERT_TRUE(reach(CameraState::kLost));
  play(seconds(5));
  EXPECT_EQ(session_->status().state, CameraState::kLost);
  EXPECT_THAT(session_->status().text, HasSubstr("no answer"));
  script_->plugged = true;
  ASSERT_TRUE(reach(CameraState::kIdle, seconds(2)));
  EXPECT_EQ(session_->status().text, "");
  EXPECT_EQ(session_->status().losses, 1);
}

TEST_F(CameraSessionTest, reports_no_loss_of_the_last_take_when_it_is_idle) {
  make_ready();
  script_->start_train(1000);
  play(seconds(1));
  script_->vanished = {30, 31, 32, 33, 34, 35};
  ASSERT_TRUE(reach(CameraState::kLost, seconds(1)));
  session_->disarm();
  EXPECT_EQ(session_->status().state, CameraState::kIdle);
  EXPECT_EQ(session_->status().text, "");
  EXPECT_EQ(session_->status().last_loss, "no frame for 3 pulses after pulse 29");
}

TEST_F(CameraSessionTest, settles_again_after_a_loss_before_the_first_pulse) {
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

TEST_F(CameraSessionTest, sums_the_statistics_over_all_openings) {
  make_ready();
  script_->damaged = {3};
  script_->start_train(1000);
  play(seconds(1));
  const auto before = session_->status().link;
  EXPECT_EQ(before.damaged, 1);
  script_->plugged = false;
  ASSERT_TRUE(reach(CameraState::kLost));
  script_->plugged = true;
  play(seconds(1));
  EXPECT_EQ(session_->status().link.damaged, 1);
  EXPECT_GT(session_->status().link.completed, before.completed);
}

}  // namespace
}  // namespace v3d::capture
