// What a camera worker does, one step at a time and without a thread: tests drive it with a
// scripted camera and a clock of their own.
#pragma once

#include <deque>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "base/image/frame.h"
#include "capture/cameras/camera.h"
#include "capture/cameras/camera_resume_state.h"
#include "capture/cameras/camera_worker.h"
#include "capture/sync/pulse_matcher.h"
#include "capture/sync/train_start.h"

namespace v3d {

/// One thread. Time is what `now` says; a step takes at most kLongestStep of it in a take, and
/// kIdleStep otherwise (opening a camera aside).
///
/// The first frames of a train are held back until it is known which pulse they are of: mostly not
/// at all, at most kStartFrames.
class CameraSession {
 public:
  static constexpr Duration kLongestStep = std::chrono::milliseconds(20);
  static constexpr Duration kIdleStep = std::chrono::milliseconds(200);

  CameraSession(std::string camera, CameraWorker::Factory make_camera, CameraWorkerOptions options);

  void arm(Duration period, bool edges_are_told);
  void rejoin(Duration period, bool edges_are_told, const CameraResumeState& past);
  /// A pulse of the train. From the first one on, a frame is due.
  void pulse_at(const PulseEdge& edge);
  void train_ended() { expecting_ = false; }
  void disarm();

  /// Does what is due: opens the camera, or waits for a frame. Returns a frame that belongs to the
  /// take.
  std::optional<Frame> step();

  /// Nothing to do before this instant (a camera that could not be opened); in the past otherwise.
  MonotonicInstant idle_until() const { return retry_at_; }

  /// Lets the camera go. The next step() opens it again.
  void close();

  /// `dropped` is not known here.
  CameraWorkerStatus status() const;

 private:
  void go_on();
  void open();
  void reopen(const std::string& why);
  void miss(const std::string& why);
  void check_quiet(MonotonicInstant now);
  void check_loss(MonotonicInstant now);
  MonotonicInstant next_look() const;
  void hear(CameraFrame frame);
  /// Labels the frames that are held back, when it is known which pulse the first is.
  void begin(bool no_more);
  void begin_late(bool no_more);
  void deliver_held(size_t strays);
  std::vector<FrameStamp> held_stamps() const;
  void deliver(CameraFrame frame, PulseMatch match);
  PulseMatch match(const CameraFrame& frame);
  void learn_latency(int64_t pulse, MonotonicInstant received);
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
  StartEvidence start_;
  bool edges_are_told_ = false;
  bool joins_late_ = false;        ///< a train that runs already
  bool goes_on_ = false;           ///< and the matcher knows frames from before
  std::deque<CameraFrame> held_;   ///< the first frames, not yet labelled
  std::deque<Frame> labelled_;     ///< on their way out
  MonotonicInstant last_frame_{};  ///< or when it was armed or opened
  std::optional<uint64_t> last_counter_;
  int64_t damaged_at_last_ = 0;  ///< damaged frames until the last whole one, or until the quiet
  bool ready_ = false;           ///< quiet
  bool begun_ = false;           ///< a frame of the take has come
  bool expecting_ = false;       ///< pulses come
  bool missing_ = false;         ///< lost, and no frame since

  /// From a pulse to the arrival of its frame, the least of kStartFrames and more; bridges trains.
  std::optional<Duration> latency_;
  Duration least_latency_{};  ///< of this train
  size_t punctual_ = 0;       ///< frames of this train that least_latency_ is of

  CameraWorkerStatus counts_;  ///< frames, suspect, losses, last_loss, last_pulse, size, format
};

}  // namespace v3d
