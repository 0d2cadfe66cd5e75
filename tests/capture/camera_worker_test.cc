#include "capture/camera_worker.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <condition_variable>
#include <deque>
#include <functional>
#include <mutex>
#include <thread>

#include "capture/camera_pilot.h"
#include "scripted_camera.h"

namespace v3d {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;
using testing::HasSubstr;

/// A pilot on the script's clock.
class CameraPilotTest : public testing::Test {
 protected:
  CameraPilotTest() {
    CameraWorkerOptions options;
    options.now = [s = script_] { return s->now; };
    pilot_ = std::make_unique<CameraPilot>(
        "cam07", [s = script_] { return std::make_unique<ScriptedCamera>(s); }, options);
  }

  /// Steps until the state is reached; false after `limit` of the script's time.
  bool reach(CameraState state, Duration limit = seconds(30)) {
    const MonotonicInstant deadline = script_->now + limit;
    while (pilot_->status().state != state) {
      if (script_->now > deadline) return false;
      step();
    }
    return true;
  }

  void step() {
    if (pilot_->idle_until() > script_->now) script_->now = pilot_->idle_until();
    if (sensed_) tell_edges();
    if (auto frame = pilot_->step()) frames_.push_back(std::move(*frame));
  }

  void tell_edges() {
    if (script_->train != told_train_) told_ = 0;
    told_train_ = script_->train;
    for (; told_train_ && told_ < script_->pulses; ++told_) {
      if (script_->exposure(told_) > script_->now) return;
      pilot_->pulse_at({.pulse = told_, .at = script_->exposure(told_)});
    }
  }

  void play(Duration time) {
    const MonotonicInstant end = script_->now + time;
    while (script_->now < end) step();
  }

  void make_ready() {
    pilot_->disarm();
    ASSERT_TRUE(reach(CameraState::kIdle));
    pilot_->arm(Script::kPeriod, sensed_);
    ASSERT_TRUE(reach(CameraState::kReady));
  }

  /// Frames whose label is not the pulse that their picture shows.
  int mislabelled() const {
    int wrong = 0;
    for (const Frame& f : frames_) wrong += f.label.pulse % 256 != f.image.bytes[0];
    return wrong;
  }

  std::shared_ptr<Script> script_ = std::make_shared<Script>();
  std::unique_ptr<CameraPilot> pilot_;
  std::vector<Frame> frames_;
  bool sensed_ = false;  ///< the camera is told of pulses
  std::optional<MonotonicInstant> told_train_;
  int64_t told_ = 0;
};

/// With a line that senses the pulses, and a train behind it, as the background is.
class SensedCameraPilotTest : public CameraPilotTest {
 protected:
  SensedCameraPilotTest() { sensed_ = true; }

  void train(int64_t pulses) {
    make_ready();
    frames_.clear();
    script_->start_train(pulses);
    play((pulses + 1) * Script::kPeriod);
    pilot_->train_ended();
    play(seconds(1));
  }
  void train_before() {
    train(16);
    ASSERT_EQ(frames_.size(), 16U);
  }
  std::vector<int64_t> pulses() const {
    std::vector<int64_t> all;
    for (const Frame& f : frames_) all.push_back(f.label.pulse);
    return all;
  }
};

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
  EXPECT_LE(script_->now, script_->exposure(3) + CameraPilot::kLongestStep);
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

  CameraPast past_;
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
    pilot_ = std::make_unique<CameraPilot>(
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

/// A camera on the real clock whose frames the test hands in.
struct Hand {
  std::mutex mutex;
  std::condition_variable changed;
  std::deque<CameraFrame> frames;
  uint64_t counter = 0;

  void expose() {
    const std::lock_guard lock(mutex);
    CameraFrame frame;
    frame.image = Image({4, 2}, PixelFormat::kMono8);
    frame.counter = ++counter;
    frame.device_time = from_ns<DeviceClock>(static_cast<int64_t>(counter) * 1'000'000);
    frame.received = Monotonic::now();
    frames.push_back(std::move(frame));
    changed.notify_all();
  }
};

class HandFedCamera : public Camera {
 public:
  explicit HandFedCamera(std::shared_ptr<Hand> hand) : hand_(std::move(hand)) {}
  void start() override {}
  void stop() override {}
  std::optional<CameraFrame> wait(MonotonicInstant deadline) override {
    std::unique_lock lock(hand_->mutex);
    hand_->changed.wait_for(lock, deadline - Monotonic::now(),
                            [&] { return !hand_->frames.empty(); });
    if (hand_->frames.empty()) return {};
    CameraFrame frame = std::move(hand_->frames.front());
    hand_->frames.pop_front();
    return frame;
  }
  CameraStatistics statistics() const override { return {}; }
  bool lost() const override { return false; }
  ImageSize size() const override { return {4, 2}; }
  PixelFormat format() const override { return PixelFormat::kMono8; }

 private:
  std::shared_ptr<Hand> hand_;
};

bool eventually(const std::function<bool()>& condition) {
  const auto deadline = Monotonic::now() + seconds(20);
  while (!condition()) {
    if (Monotonic::now() > deadline) return false;
    std::this_thread::yield();
  }
  return true;
}

class CameraWorkerTest : public testing::Test {
 protected:
  std::unique_ptr<CameraWorker> worker(size_t queue_frames) {
    CameraWorkerOptions options;
    options.queue_frames = queue_frames;
    options.reopen_after = std::chrono::hours(1);
    return std::make_unique<CameraWorker>(
        "cam07", [h = hand_] { return std::make_unique<HandFedCamera>(h); }, options);
  }
  bool ready(CameraWorker& worker) {
    worker.arm(milliseconds(1));
    return eventually([&] { return worker.status().state == CameraState::kReady; });
  }

  std::shared_ptr<Hand> hand_ = std::make_shared<Hand>();
};

TEST_F(CameraWorkerTest, hands_over_labelled_frames_in_order) {
  const auto w = worker(16);
  ASSERT_TRUE(ready(*w));
  for (int64_t pulse = 0; pulse < 100; ++pulse) {
    hand_->expose();
    const auto frame = w->take(Monotonic::now() + seconds(20));
    ASSERT_TRUE(frame);
    EXPECT_EQ(frame->label.pulse, pulse);
  }
  EXPECT_FALSE(w->take(Monotonic::now()));
  EXPECT_EQ(w->status().dropped, 0);
}

TEST_F(CameraWorkerTest, drops_the_oldest_frames_of_a_full_queue_and_counts_them) {
  const auto w = worker(4);
  ASSERT_TRUE(ready(*w));
  for (int i = 0; i < 10; ++i) hand_->expose();
  ASSERT_TRUE(eventually([&] { return w->status().frames == 10; }));
  EXPECT_EQ(w->status().dropped, 6);
  for (int64_t pulse = 6; pulse < 10; ++pulse) {
    EXPECT_EQ(w->take(Monotonic::now() + seconds(20))->label.pulse, pulse);
  }
}

TEST_F(CameraWorkerTest, forgets_the_take_before_when_it_is_armed_again) {
  const auto w = worker(16);
  for (int take = 0; take < 5; ++take) {
    ASSERT_TRUE(ready(*w));
    EXPECT_EQ(w->status().frames, 0);
    hand_->expose();
    const auto frame = w->take(Monotonic::now() + seconds(20));
    ASSERT_TRUE(frame);
    EXPECT_EQ(frame->label.pulse, 0);
    hand_->expose();
    ASSERT_TRUE(eventually([&] { return w->status().frames == 2; }));
  }
}

TEST_F(CameraWorkerTest, keeps_frames_that_come_while_the_train_ends) {
  const auto w = worker(1000);
  ASSERT_TRUE(ready(*w));
  for (int i = 0; i < 500; ++i) {
    hand_->expose();
    if (i % 10 == 0) w->train_ended();
  }
  ASSERT_TRUE(eventually([&] { return w->status().frames == 500; }));
  for (int64_t pulse = 0; pulse < 500; ++pulse) {
    ASSERT_EQ(w->take(Monotonic::now() + seconds(20))->label.pulse, pulse);
  }
}

TEST_F(CameraWorkerTest, tells_in_its_text_what_the_factory_threw) {
  const CameraWorker w(
      "cam07", []() -> std::unique_ptr<Camera> { throw InputError("camera cam07: no such kind"); });
  EXPECT_TRUE(eventually([&] { return w.status().text == "camera cam07: no such kind"; }));
  EXPECT_EQ(w.status().state, CameraState::kOpening);
}

TEST_F(CameraWorkerTest, ends_at_any_moment) {
  for (int i = 0; i < 50; ++i) {
    const auto w = worker(4);
    if (i % 2) w->arm(milliseconds(1));
  }
}

}  // namespace
}  // namespace v3d
