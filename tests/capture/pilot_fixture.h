// A pilot before a scripted camera, for the tests of what pilots do.
#pragma once

#include <gtest/gtest.h>

#include <memory>
#include <optional>
#include <vector>

#include "capture/cameras/camera_session.h"
#include "scripted_camera.h"

namespace v3d {

/// A pilot on the script's clock.
class CameraPilotTest : public testing::Test {
 protected:
  CameraPilotTest() {
    CameraWorkerOptions options;
    options.now = [s = script_] { return s->now; };
    pilot_ = std::make_unique<CameraSession>(
        "cam07", [s = script_] { return std::make_unique<ScriptedCamera>(s); }, options);
  }

  /// Steps until the state is reached; false after `limit` of the script's time.
  bool reach(CameraState state, Duration limit = std::chrono::seconds(30)) {
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
  std::unique_ptr<CameraSession> pilot_;
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

}  // namespace v3d
