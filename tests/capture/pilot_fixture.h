// Test fixtures: CameraSession with a scripted camera.
#pragma once

#include <gtest/gtest.h>

#include <memory>
#include <optional>
#include <vector>

#include "capture/cameras/camera_session.h"
#include "scripted_camera.h"

namespace v3d::capture {

/// A session with a scripted camera, on the script's clock.
class CameraSessionTest : public testing::Test {
 protected:
  CameraSessionTest() {
    CameraWorkerOptions options;
    options.now = [s = script_] { return s->now; };
    session_ = std::make_unique<CameraSession>(
        "cam07", [s = script_] { return std::make_unique<ScriptedCamera>(s); }, options);
  }

  /// Steps until the state is reached. False if this takes longer than `limit` of the script's
  /// time.
  bool reach(CameraState state, Duration limit = std::chrono::seconds(30)) {
    const MonotonicInstant deadline = script_->now + limit;
    while (session_->status().state != state) {
      if (script_->now > deadline) return false;
      step();
    }
    return true;
  }

  void step() {
    if (session_->idle_until() > script_->now) script_->now = session_->idle_until();
    if (sensed_) report_edges();
    if (auto frame = session_->step()) frames_.push_back(std::move(*frame));
  }

  void report_edges() {
    if (script_->train != reported_train_) reported_pulses_ = 0;
    reported_train_ = script_->train;
    for (; reported_train_ && reported_pulses_ < script_->pulses; ++reported_pulses_) {
      const MonotonicInstant at = script_->exposure(reported_pulses_);
      if (at + report_delay_ > script_->now) return;
      session_->pulse_at({.pulse = reported_pulses_,
                          .at = reports_are_timed_ ? at + time_error_ : script_->now,
                          .is_timed = reports_are_timed_});
    }
  }

  void play(Duration time) {
    const MonotonicInstant end = script_->now + time;
    while (script_->now < end) step();
  }

  void make_ready() {
    session_->disarm();
    ASSERT_TRUE(reach(CameraState::kIdle));
    session_->arm(script_->period, sensed_);
    ASSERT_TRUE(reach(CameraState::kReady));
  }

  /// Number of frames whose label differs from the pulse that their image shows.
  int mislabelled() const {
    int wrong = 0;
    for (const Frame& f : frames_) wrong += f.label.pulse % 256 != f.image.bytes[0];
    return wrong;
  }

  std::shared_ptr<Script> script_ = std::make_shared<Script>();
  std::unique_ptr<CameraSession> session_;
  std::vector<Frame> frames_;
  bool sensed_ = false;  ///< pulses are reported to the session
  Duration report_delay_{};
  bool reports_are_timed_ = true;
  Duration time_error_{};  ///< of the reported times
  std::optional<MonotonicInstant> reported_train_;
  int64_t reported_pulses_ = 0;
};

/// A session with a sense line. train_before() records a first train, which gives the latency.
class SensedCameraSessionTest : public CameraSessionTest {
 protected:
  SensedCameraSessionTest() { sensed_ = true; }

  void train(int64_t pulses) {
    make_ready();
    frames_.clear();
    script_->start_train(pulses);
    play((pulses + 1) * script_->period);
    session_->train_ended();
    play(std::chrono::seconds(1));
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

}  // namespace v3d::capture
