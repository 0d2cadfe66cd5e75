// Interface of a camera backend. AravisCamera, V4l2Camera and FreeRunningCamera implement it.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>

#include "base/core/time.h"
#include "base/image/image.h"

namespace v3d {

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
  std::optional<double> exposure_us = {};   ///< exposure time in the chunk data
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
};

}  // namespace v3d
