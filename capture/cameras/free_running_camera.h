// A camera that nothing triggers, in a studio of pulses.
#pragma once

#include <atomic>
#include <deque>
#include <functional>
#include <memory>

#include "capture/cameras/camera.h"
#include "capture/sync/pulse_times.h"

namespace v3d {

/// Delivers the frames of a camera that runs at the rate of the pulses, on its own clock, each with
/// the pulse that was nearest to it (PulseTimes::find), and none while there are no pulses: so it
/// is quiet between takes as a triggered camera is. It is not synchronous, and does not look so:
/// the phase is in the statistics, and where the camera's clock has slipped by a period against the
/// pulses, a pulse has no frame, or two. A frame waits for the pulse after it, a camera's silence
/// of a second is its loss.
///
/// Requires that device times of the camera are of this host's CLOCK_MONOTONIC.
class FreeRunningCamera : public Camera {
 public:
  /// How the camera is told its rate, Hz: for the next start().
  using SetRate = std::function<void(double rate_hz)>;
  using Now = std::function<MonotonicInstant()>;

  /// `pulses` outlives the camera.
  FreeRunningCamera(std::unique_ptr<Camera> camera, SetRate set_rate, const PulseTimes& pulses,
                    Now now = Monotonic::now);

  void start() override;
  void stop() override;
  std::optional<CameraFrame> wait(MonotonicInstant deadline) override;
  CameraStatistics statistics() const override;
  bool lost() const override { return lost_ || camera_->lost(); }
  ImageSize size() const override { return camera_->size(); }
  PixelFormat format() const override { return camera_->format(); }

 private:
  void follow_train();
  void receive(MonotonicInstant deadline);
  std::optional<CameraFrame> labelled();

  const std::unique_ptr<Camera> camera_;
  const SetRate set_rate_;
  const PulseTimes& pulses_;
  const Now now_;
  Duration period_{};             ///< that it runs at
  int64_t train_ = 0;             ///< that phase_ is of
  std::deque<CameraFrame> held_;  ///< not labelled yet, the oldest first
  MonotonicInstant last_{};       ///< frame, or start
  std::optional<Duration> phase_;
  std::atomic<bool> lost_ = false;
  std::atomic<bool> has_phase_ = false;
  std::atomic<Duration> told_phase_ = Duration{};
};

}  // namespace v3d
