// State machine of one camera: opens it, labels its frames, detects its loss and reopens it.
#pragma once

#include <deque>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "base/image/frame.h"
#include "capture/cameras/camera.h"
#include "capture/cameras/camera_worker.h"
#include "capture/sync/pulse_matcher.h"
#include "capture/sync/pulse_times.h"

namespace v3d::capture {

/// CameraWorker calls step() in a loop on its thread. Tests call it with a scripted camera and a
/// simulated clock. Not thread-safe.
///
/// CameraWorkerOptions::now is the clock. A step takes at most kMaxStep in a take and at most
/// kIdleStep otherwise, except for the time to open a camera.
///
/// The first frames of a train are held until their pulse is known: mostly none, at most
/// kStartFrames, and kMaxStartFrames after a stall of this host, or after rejoin() until a pulse is
/// reported.
///
/// A camera that was ready, and is lost before the first pulse, joins the train when it is open
/// again: with the next reported pulse, or where none are reported, with the eighth frame. Without
/// the time of a pulse, all its frames are suspect.
///
/// A camera counts as silent only while step() waits. While this host stalls, frames may be
/// waiting.
class CameraSession {
 public:
  static constexpr Duration kMaxStep = std::chrono::milliseconds(20);
  static constexpr Duration kIdleStep = std::chrono::milliseconds(200);

  CameraSession(std::string camera, CameraWorker::Factory make_camera, CameraWorkerOptions options);

  /// See CameraWorker::arm() and CameraWorker::rejoin().
  void arm(Duration period, bool edges_are_reported);
  void rejoin(Duration period, bool edges_are_reported, const CameraResumeState& past);
  /// Reports a pulse of the train. Frames are expected from the first pulse on.
  void pulse_at(const PulseEdge& edge);
  /// No pulse follows: frames in flight still arrive, and no further ones are expected.
  void train_ended();
  void disarm();

  /// Opens the camera or waits for a frame. Returns a labelled frame of the take, if there is one.
  std::optional<Frame> step();

  /// Time of the next attempt to open the camera. It lies in the past if step() may be called now.
  MonotonicInstant idle_until() const { return retry_at_; }

  /// Closes the camera. The next step() opens it again.
  void close();

  /// CameraWorkerStatus::dropped is 0; CameraWorker sets it.
  CameraWorkerStatus status() const;

 private:
  void advance();
  void open();
  void reopen(const std::string& why);
  void report_missing(const std::string& why);
  /// Restarts the measurement of silence_ at `at`.
  void reset_silence(MonotonicInstant at);
  void observe_silence();
  void check_quiet();
  void join_late();
  void check_loss();
  MonotonicInstant wait_deadline() const;
  void receive(CameraFrame frame);
  void expect_frames() { expecting_ = !train_is_over_; }
  /// Whether held frames may be of pulses. Where pulses are reported, a frame before the first
  /// report proves no pulse.
  bool pulses_have_begun() const { return !edges_are_reported_ || expecting_ || train_is_over_; }
  /// Labels the held frames if the pulse of the first one is known. `no_more`: do not wait for
  /// further frames.
  void label_first_frames(bool no_more);
  void label_resumed_frames(bool no_more);
  void expect_after(const PulseEdge& edge);
  bool is_resuming() const { return matcher_ && matcher_->is_resuming(); }
  void deliver_held(size_t strays);
  void set_aside(size_t count);
  void deliver_strays();
  std::vector<FrameStamp> held_stamps() const;
  void deliver(CameraFrame frame, PulseMatch match);
  PulseMatch match(const CameraFrame& frame);
  void learn_latency(int64_t pulse, MonotonicInstant received);
  CameraState state() const;
  bool in_take() const { return matcher_ && (ready_ || running_); }

  const std::string name_;
  const CameraWorker::Factory make_camera_;
  const CameraWorkerOptions options_;

  std::unique_ptr<Camera> camera_;  ///< empty if not streaming
  MonotonicInstant retry_at_{};
  CameraStatistics link_before_;  ///< sum over the previous times the camera was open
  std::string text_;

  // State of the take. Without a take matcher_ is empty.
  Duration period_{};
  std::optional<PulseMatcher> matcher_;
  StartEvidence start_;
  bool edges_are_reported_ = false;
  bool joins_late_ = false;         ///< joins a train that is already running
  bool resumes_take_ = false;       ///< rejoins with frames from before the restart in the matcher
  std::deque<CameraFrame> held_;    ///< first frames, not yet labelled
  std::deque<CameraFrame> strays_;  ///< exposed before the pulses; delivered after pulse 0
  std::deque<Frame> labelled_;      ///< frames that step() returns next
  MonotonicInstant last_frame_{};   ///< arrival of the last frame, or time of arm() or open()
  MonotonicInstant checked_{};      ///< last call of observe_silence()
  Duration silence_{};              ///< time waited for a frame since last_frame_
  std::optional<uint64_t> last_counter_;
  int64_t damaged_at_last_ = 0;  ///< count of damaged frames at the last complete one or at ready
  bool ready_ = false;           ///< the camera was silent for kQuietPeriods after arm()
  bool was_ready_ = false;       ///< the camera was ready once since arm(), so the take has it
  size_t unquiet_frames_ = 0;    ///< frames since it was reopened, while it was not ready
  bool running_ = false;         ///< frames of the take are delivered
  bool expecting_ = false;       ///< pulses are running, so frames must arrive
  bool train_is_over_ = false;   ///< train_ended() was called
  bool missing_ = false;         ///< reported as lost, and no frame has arrived since

  /// Minimum time from a pulse to the arrival of its frame, of at least kStartFrames frames. Kept
  /// from train to train.
  std::optional<Duration> latency_;
  Duration min_latency_{};     ///< minimum of this train
  size_t latency_frames_ = 0;  ///< number of frames of this train in min_latency_

  /// Valid fields: frames, suspect, losses, last_loss, last_pulse, size, format,
  /// device, differences.
  CameraWorkerStatus counts_;
};

}  // namespace v3d::capture
