// Adapter for a free-running camera: labels each frame with the nearest pulse.
#pragma once

#include <atomic>
#include <deque>
#include <functional>
#include <memory>

#include "capture/cameras/camera.h"
#include "capture/sync/pulse_times.h"

namespace v3d {

/// The camera runs at the pulse rate, on its own clock. Each frame gets the nearest pulse
/// (PulseTimes::find). Frames without a pulse are dropped, so that the camera is silent between
/// takes, as a triggered camera is.
///
/// The camera is not synchronous: statistics() reports its phase. After its clock has drifted by a
/// period against the pulses, a pulse has no frame, or two. A frame may wait for the pulse after
/// it. The camera counts as lost after a silence of 1 s or 3 periods, whichever is longer.
///
/// Requires that device times of the camera are this host's CLOCK_MONOTONIC.
class FreeRunningCamera : public Camera {
 public:
  /// Sets the frame rate of the camera, Hz, for its next start().
  using SetRate = std::function<void(double rate_hz)>;
  using Now = std::function<MonotonicInstant()>;

  /// `pulses` must outlive this object.
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
  Duration period_{};             ///< of the camera's frames
  int64_t train_ = 0;             ///< number of the train that phase_ belongs to
  std::deque<CameraFrame> held_;  ///< not labelled yet, oldest first
  MonotonicInstant last_{};       ///< arrival of the last frame, or time of start()
  std::optional<Duration> phase_;
  std::atomic<bool> lost_ = false;
  std::atomic<bool> has_phase_ = false;
  std::atomic<Duration> reported_phase_ = Duration{};
};

}  // namespace v3d
