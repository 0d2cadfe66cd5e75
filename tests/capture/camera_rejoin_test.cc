// CameraSession that rejoins a take which another process started.

#include <gtest/gtest.h>

#include <algorithm>

#include "capture/cameras/camera_session.h"
#include "pilot_fixture.h"

namespace v3d::capture {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

/// A train at 25 Hz, of which another process labelled the first frames.
class RejoiningCameraSessionTest : public SensedCameraSessionTest {
 protected:
  static constexpr int64_t kKnown = 60;

  /// Rejoins after `gap` further pulses, and plays 39 periods, or as many as requested.
  void rejoin_after(int64_t gap, int64_t played = 39) {
    script_->start_train(kKnown + gap + played + 1);
    for (int64_t pulse = 0; pulse < kKnown; ++pulse) {
      const DeviceInstant exposed = from_ns<DeviceClock>(
          (script_->exposure(pulse).time_since_epoch() + script_->device_zero).count());
      past_.frames.push_back(
          {{exposed, 100 + static_cast<uint64_t>(pulse), script_->exposure(pulse) + latency_},
           pulse});
    }
    past_.delivered = kKnown;
    if (!latency_is_unknown_) past_.latency = Script::kLatency + latency_error_;
    if (state_is_empty_) past_ = {};
    script_->now = script_->exposure(kKnown + gap) - milliseconds(1);
    script_->device_zero += clock_jumps_;
    reported_train_ = script_->train;
    reported_pulses_ = kKnown + gap;
    session_->rejoin(Script::kPeriod, sensed_, past_);
    play(played * Script::kPeriod);
    EXPECT_GE(std::ssize(frames_), played - 4);
    EXPECT_EQ(mislabelled_without_suspicion(), 0);
  }
  int mislabelled_without_suspicion() const {
    return static_cast<int>(std::ranges::count_if(frames_, [](const Frame& f) {
      return !f.label.suspect && f.label.pulse % 256 != f.image.bytes[0];
    }));
  }
  int64_t suspect() const {
    return std::ranges::count_if(frames_, [](const Frame& f) { return f.label.suspect; });
  }

  CameraResumeState past_;
  Duration latency_ = Script::kLatency;
  Duration latency_error_{};  ///< of the latency that is passed to rejoin()
  Duration clock_jumps_{};
  bool latency_is_unknown_ = false;
  bool state_is_empty_ = false;
};

TEST_F(RejoiningCameraSessionTest, labels_every_frame_correctly_if_the_camera_clock_kept_running) {
  rejoin_after(100);
  EXPECT_EQ(suspect(), 0);
  EXPECT_EQ(mislabelled(), 0);
  EXPECT_EQ(session_->status().frames, kKnown + std::ssize(frames_)) << "of the take";
  EXPECT_EQ(session_->status().losses, 0);
}

TEST_F(RejoiningCameraSessionTest, labels_frames_correctly_again_after_minutes) {
  script_->device_zero += seconds(5);
  rejoin_after(20'000);
  EXPECT_EQ(frames_.back().label.pulse % 256, frames_.back().image.bytes[0]);
  EXPECT_LE(suspect(), 9);
  EXPECT_FALSE(frames_.back().label.suspect);
}

/// Before and after the 24th held frame: until it, frames wait for the report of a pulse.
TEST_F(RejoiningCameraSessionTest,
       labels_frames_correctly_again_after_minutes_however_late_pulses_are_reported) {
  for (const int periods : {5, 10, 20, 28}) {
    report_delay_ = periods * Script::kPeriod;
    session_->close();
    frames_.clear();
    past_ = {};
    rejoin_after(20'000);
    EXPECT_FALSE(frames_.back().label.suspect) << periods;
    EXPECT_EQ(frames_.back().label.pulse % 256, frames_.back().image.bytes[0]) << periods;
    EXPECT_FALSE(session_->status().is_resuming) << periods;
  }
}

TEST_F(RejoiningCameraSessionTest, suspects_all_frames_while_no_pulse_is_reported_after_minutes) {
  report_delay_ = std::chrono::hours(1);
  rejoin_after(20'000);
  EXPECT_EQ(suspect(), std::ssize(frames_));
  EXPECT_TRUE(session_->status().is_resuming);
}

TEST_F(RejoiningCameraSessionTest, accepts_a_restarted_camera_clock_after_enough_arrivals) {
  clock_jumps_ = -std::chrono::hours(3);
  rejoin_after(100);
  EXPECT_TRUE(frames_.front().label.suspect);
  EXPECT_LE(suspect(), 9);
  EXPECT_FALSE(frames_.back().label.suspect);
}

/// Either the camera's clock or this host's was set; the matcher cannot distinguish the two.
TEST_F(RejoiningCameraSessionTest,
       suspects_all_frames_if_a_running_clock_contradicts_the_arrivals) {
  clock_jumps_ = 3 * Script::kPeriod;
  rejoin_after(100);
  EXPECT_EQ(suspect(), std::ssize(frames_));
}

/// The fit of the camera's clock is not updated meanwhile, so its standard deviation grows.
TEST_F(RejoiningCameraSessionTest,
       suspects_all_frames_of_many_minutes_if_a_running_clock_contradicts_the_arrivals) {
  for (const int periods : {-2, -1, 1, 2}) {
    session_->close();
    frames_.clear();
    past_ = {};
    latency_error_ = periods * Script::kPeriod;
    rejoin_after(300, 12'000);
    EXPECT_EQ(suspect(), std::ssize(frames_)) << periods;
  }
}

TEST_F(RejoiningCameraSessionTest, labels_frames_correctly_again_after_wrong_times_of_pulses) {
  time_error_ = 3 * Script::kPeriod;
  rejoin_after(750, 400);
  EXPECT_EQ(suspect(), std::ssize(frames_));
  time_error_ = {};
  script_->pulses += 40;
  play(40 * Script::kPeriod);
  EXPECT_FALSE(frames_.back().label.suspect);
  EXPECT_EQ(mislabelled_without_suspicion(), 0);
}

/// Arrivals of before the restart are known by the wall clock only, which was set.
TEST_F(RejoiningCameraSessionTest,
       suspects_all_frames_of_a_restarted_camera_clock_without_a_sense_line) {
  sensed_ = false;
  latency_is_unknown_ = true;
  clock_jumps_ = -std::chrono::hours(3);
  latency_ = Script::kLatency + 2 * Script::kPeriod;
  rejoin_after(100);
  EXPECT_EQ(suspect(), std::ssize(frames_));
}

TEST_F(RejoiningCameraSessionTest, suspects_all_frames_without_frames_from_before_the_restart) {
  state_is_empty_ = true;
  rejoin_after(100);
  EXPECT_EQ(suspect(), std::ssize(frames_));
}

TEST_F(RejoiningCameraSessionTest,
       suspects_all_frames_without_earlier_frames_and_without_a_sense_line) {
  sensed_ = false;
  state_is_empty_ = true;
  rejoin_after(100);
  EXPECT_EQ(suspect(), std::ssize(frames_));
}

TEST_F(RejoiningCameraSessionTest, labels_frames_by_the_camera_clock_without_a_sense_line) {
  sensed_ = false;
  latency_is_unknown_ = true;
  rejoin_after(100);
  EXPECT_EQ(suspect(), 0);
  EXPECT_EQ(mislabelled(), 0);
}

TEST_F(RejoiningCameraSessionTest, suspects_all_frames_after_minutes_without_a_sense_line) {
  sensed_ = false;
  latency_is_unknown_ = true;
  rejoin_after(20'000);
  EXPECT_EQ(suspect(), std::ssize(frames_));
}

}  // namespace
}  // namespace v3d::capture
