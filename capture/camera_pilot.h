// What a camera worker does, one step at a time and without a thread: tests drive it with a
// scripted camera and a clock of their own.
#pragma once

#include <functional>
#include <memory>
#include <optional>
#include <string>

#include "base/frame.h"
#include "capture/camera.h"
#include "capture/camera_worker.h"
#include "capture/pulse_matcher.h"

namespace v3d {

/// One thread. Time is what `now` says; a step takes at most kLongestStep of it (opening a camera
/// aside).
class CameraPilot {
 public:
  static constexpr Duration kLongestStep = std::chrono::milliseconds(20);

  CameraPilot(std::string camera, CameraWorker::Factory make_camera, CameraWorkerOptions options);

  void arm(Duration period);
  void train_ended() { expecting_ = false; }
  void disarm();

  /// Does what is due: opens the camera, or waits for a frame. Returns a frame that belongs to the
  /// take.
  std::optional<Frame> step();

  /// Nothing to do before this instant (a camera that could not be opened); in the past otherwise.
  MonotonicInstant idle_until() const { return retry_at_; }

  /// `dropped` is not known here.
  CameraWorkerStatus status() const;

 private:
  void open();
  void close();
  void reopen(const std::string& why);
  void miss(const std::string& why);
  void check_quiet(MonotonicInstant now);
  void check_loss(MonotonicInstant now);
  FrameLabel label(const CameraFrame& frame);
  CameraState state() const;
  bool in_take() const { return matcher_ && (ready_ || begun_); }

  const std::string name_;
  const CameraWorker::Factory make_camera_;
  const CameraWorkerOptions options_;

  std::unique_ptr<Camera> camera_;  ///< empty when not streaming
  MonotonicInstant retry_at_{};
  CameraStatistics link_before_;  ///< of the times it was opened before this one
  std::string text_;

  // The take; empty matcher: none.
  Duration period_{};
  std::optional<PulseMatcher> matcher_;
  MonotonicInstant last_frame_{};  ///< or when it was armed or opened
  std::optional<uint64_t> last_counter_;
  int64_t damaged_at_last_ = 0;  ///< damaged frames until the last whole one, or until the quiet
  bool ready_ = false;           ///< quiet
  bool begun_ = false;           ///< a frame of the take has come
  bool expecting_ = false;       ///< pulses come
  bool missing_ = false;         ///< lost, and no frame since

  CameraWorkerStatus counts_;  ///< frames, suspect, losses, last_pulse, size, format
};

}  // namespace v3d
