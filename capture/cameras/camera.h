// Camera: interface, factory, resume state, adapter of free-running cameras.
#pragma once

#include <atomic>
#include <cstdint>
#include <deque>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "base/config/studio_file.h"
#include "base/core/time.h"
#include "base/image/image.h"
#include "capture/sync/pulse_matcher.h"
#include "capture/sync/pulse_times.h"

namespace v3d::capture {

// Interface of a camera backend. AravisCamera, V4l2Camera and FreeRunningCamera implement it.

/// One frame as the driver delivers it, not yet labelled with a pulse.
struct CameraFrame {
  Image image;
  DeviceInstant device_time;  ///< start of exposure on the camera's clock
  uint64_t counter = 0;       ///< the camera's frame number (64 bit, unwrapped)
  MonotonicInstant received;  ///< arrival of the last packet, or of the driver's buffer
  /// Of a free-running camera: the pulse nearest to the exposure. Empty for a triggered camera:
  /// PulseMatcher finds the pulse.
  std::optional<int64_t> pulse = {};
};

/// A setting of which a camera has another value than it was asked for, and records all the same.
struct SettingDifference {
  std::string setting;  ///< name of the camera's feature or control
  std::string asked;
  std::string got;       ///< value read back, or the reason why there is none
  bool rounded = false;  ///< within the tolerance of the setting: no cause for a warning
  friend bool operator==(const SettingDifference&, const SettingDifference&) = default;
};

/// What a camera reports about itself; empty texts where it does not.
struct CameraDevice {
  std::string model;     ///< "Maker Model"; of V4L2: the name of the device and its driver
  std::string firmware;  ///< version; V4L2 has none
  /// "Maker Model, firmware 1.2".
  std::string text() const { return firmware.empty() ? model : model + ", firmware " + firmware; }
};

/// Counters of one camera object, and the latest measured values.
struct CameraStatistics {
  int64_t completed = 0;  ///< frames that arrived complete
  int64_t damaged = 0;    ///< frames with missing packets; not delivered
  int64_t underruns = 0;  ///< frames for which there was no free buffer
  int64_t packets_resent = 0;
  int64_t packets_missing = 0;  ///< never received
  // Values of the last frame; empty if the camera does not report them.
  std::optional<Duration> phase = {};       ///< of a free-running camera: time after its pulse
  std::optional<Duration> ptp_offset = {};  ///< of the camera's clock from its PTP master
  bool ptp_locked = false;  ///< the camera's clock is a PTP slave or master, also without an offset
  std::optional<double> exposure_us = {};          ///< exposure time in the chunk data
  std::optional<double> temperature_celsius = {};  ///< of the camera
};
/// Sums the counters of two periods in which the camera was open; other values are those of `b`,
/// the later period.
CameraStatistics operator+(const CameraStatistics& a, const CameraStatistics& b);

/// A camera that delivers frames. One thread calls start(), stop() and wait(); any thread may call
/// statistics().
class Camera {
 public:
  virtual ~Camera() = default;
  /// Writes the settings, including the external trigger if there is one, and starts streaming.
  /// Throws InputError, with the names of camera and setting, if the camera is unreachable, rejects
  /// a setting or reports another value.
  virtual void start() = 0;
  virtual void stop() = 0;  ///< idempotent
  /// Waits until `deadline` for the next complete frame. Empty if none arrived.
  virtual std::optional<CameraFrame> wait(MonotonicInstant deadline) = 0;
  virtual CameraStatistics statistics() const = 0;
  /// True after the camera stopped answering. It must be started again.
  virtual bool lost() const = 0;
  virtual ImageSize size() const = 0;      ///< pixels; requires start()
  virtual PixelFormat format() const = 0;  ///< requires start()
  /// Model and firmware. Requires start().
  virtual CameraDevice device() const { return {}; }
  /// False where the settings of start() bound a triggered camera to longer periods than `period`:
  /// it must be made and started again. Requires start().
  virtual bool keeps_up_with(Duration period) const {
    (void)period;
    return true;
  }
  /// Counter of the first exposure after start(), where the camera itself counts exposures and
  /// always starts at this value. Requires start().
  virtual std::optional<uint64_t> first_counter() const { return std::nullopt; }
  /// The settings whose value differs from that asked for at start(). Requires start().
  virtual std::vector<SettingDifference> differences() const { return {}; }
};

// Factory of cameras: selects the backend by the studio file.

/// Creates the camera object without accessing the device; start() opens it. `pulses`, the pulses
/// of this node, label the frames of a free-running camera and must outlive it.
std::unique_ptr<Camera> make_camera(const StudioCamera& settings, const PulseTimes& pulses);

// State of a camera in a running take, restored after a restart of the process.

struct CameraResumeState {
  std::vector<KnownFrame> frames;     ///< the last non-suspect frames; times of this host's clock
  std::optional<Duration> latency{};  ///< minimum time from a pulse to the arrival of its frame
  int64_t delivered = 0;              ///< frames of the take
  int64_t suspect = 0;                ///< suspect frames among these
};

// Adapter for a free-running camera: labels each frame with the nearest pulse.

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
  CameraDevice device() const override { return camera_->device(); }
  std::vector<SettingDifference> differences() const override { return camera_->differences(); }

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

}  // namespace v3d::capture
