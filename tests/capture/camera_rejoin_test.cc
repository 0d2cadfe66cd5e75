// A camera whose take another process has begun.

#include <gtest/gtest.h>

#include <algorithm>

#include "capture/cameras/camera_session.h"
#include "pilot_fixture.h"

namespace v3d {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

/// A train of which another process has labelled the first frames. 25 Hz.
class RejoiningPilotTest : public SensedCameraPilotTest {
 protected:
  static constexpr int64_t kKnown = 60;

  /// The pulses have run for `gap` more when this process is ready.
  void rejoin_after(int64_t gap) {
    script_->start_train(kKnown + gap + 40);
    for (int64_t pulse = 0; pulse < kKnown; ++pulse) {
      const DeviceInstant exposed = from_ns<DeviceClock>(
          (script_->exposure(pulse).time_since_epoch() + script_->device_zero).count());
      past_.frames.push_back(
          {{exposed, 100 + static_cast<uint64_t>(pulse), script_->exposure(pulse) + latency_},
           pulse});
    }
    past_.delivered = kKnown;
    if (!forgets_latency_) past_.latency = Script::kLatency;
    if (knows_nothing_) past_ = {};
    script_->now = script_->exposure(kKnown + gap) - milliseconds(1);
    script_->device_zero += clock_jumps_;
    told_train_ = script_->train;
    told_ = kKnown + gap;
    pilot_->rejoin(Script::kPeriod, sensed_, past_);
    play(39 * Script::kPeriod);
    EXPECT_GE(frames_.size(), 35U);
    EXPECT_EQ(mislabelled_silently(), 0);
  }
  int mislabelled_silently() const {
    return static_cast<int>(std::ranges::count_if(frames_, [](const Frame& f) {
      return !f.label.suspect && f.label.pulse % 256 != f.image.bytes[0];
    }));
  }
  int64_t suspect() const {
    return std::ranges::count_if(frames_, [](const Frame& f) { return f.label.suspect; });
  }

  CameraResumeState past_;
  Duration latency_ = Script::kLatency;
  Duration clock_jumps_{};
  bool forgets_latency_ = false;
  bool knows_nothing_ = false;
};

TEST_F(RejoiningPilotTest, labels_every_frame_rightly_where_the_camera_s_clock_has_gone_on) {
  rejoin_after(100);
  EXPECT_EQ(suspect(), 0);
  EXPECT_EQ(mislabelled(), 0);
  EXPECT_EQ(pilot_->status().frames, kKnown + std::ssize(frames_)) << "of the take";
  EXPECT_EQ(pilot_->status().losses, 0);
}

TEST_F(RejoiningPilotTest, finds_its_place_again_after_minutes) {
  script_->device_zero += seconds(5);
  rejoin_after(20'000);
  EXPECT_EQ(frames_.back().label.pulse % 256, frames_.back().image.bytes[0]);
  EXPECT_LE(suspect(), 9);
  EXPECT_FALSE(frames_.back().label.suspect);
}

TEST_F(RejoiningPilotTest, believes_a_camera_with_a_new_clock_when_its_arrivals_have_proved_it) {
  clock_jumps_ = -std::chrono::hours(3);
  rejoin_after(100);
  EXPECT_TRUE(frames_.front().label.suspect);
  EXPECT_LE(suspect(), 9);
  EXPECT_FALSE(frames_.back().label.suspect);
}

/// Either the camera's clock was set, or this host's: nobody can tell.
TEST_F(RejoiningPilotTest, stays_in_doubt_where_a_clock_that_went_on_contradicts_the_arrivals) {
  clock_jumps_ = 3 * Script::kPeriod;
  rejoin_after(100);
  EXPECT_EQ(suspect(), std::ssize(frames_));
}

TEST_F(RejoiningPilotTest, stays_in_doubt_where_no_frame_is_known_from_before) {
  knows_nothing_ = true;
  rejoin_after(100);
  EXPECT_EQ(suspect(), std::ssize(frames_));
}

TEST_F(RejoiningPilotTest, goes_by_the_camera_s_clock_where_nothing_senses_the_pulses) {
  sensed_ = false;
  forgets_latency_ = true;
  rejoin_after(100);
  EXPECT_EQ(suspect(), 0);
  EXPECT_EQ(mislabelled(), 0);
}

TEST_F(RejoiningPilotTest, knows_its_limits_where_nothing_senses_the_pulses) {
  sensed_ = false;
  forgets_latency_ = true;
  rejoin_after(20'000);
  EXPECT_EQ(suspect(), std::ssize(frames_));
}

}  // namespace
}  // namespace v3d
