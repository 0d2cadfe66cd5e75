// A camera, behind one small interface; aravis and v4l2 cameras implement it.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>

#include "base/core/time.h"
#include "base/image/image.h"

namespace v3d {

/// One exposure as it left the driver, not yet labelled with a pulse.
struct CameraFrame {
  Image image;
  DeviceInstant device_time;  ///< start of exposure on the camera's clock
  uint64_t counter = 0;       ///< the camera's frame number (64 bit, unwrapped)
  MonotonicInstant received;  ///< the last packet arrived
  /// Of a camera that runs free: the pulse nearest to it. Empty: the pulse exposed it, and has to
  /// be found (pulse_matcher.h).
  std::optional<int64_t> pulse = {};
};

struct CameraStatistics {
  int64_t completed = 0;  ///< frames that arrived whole
  int64_t damaged = 0;    ///< frames with missing packets; not delivered
  int64_t underruns = 0;  ///< no free buffer
  int64_t packets_resent = 0;
  int64_t packets_missing = 0;  ///< for good
  // Of the last frame, where the camera tells.
  std::optional<Duration> phase = {};       ///< after its pulse: a camera that runs free
  std::optional<Duration> ptp_offset = {};  ///< of its clock, from its PTP master
  std::optional<double> exposure_us = {};   ///< by its chunk data
};
/// Of two times that a camera was open, the earlier one first.
CameraStatistics operator+(const CameraStatistics& a, const CameraStatistics& b);

/// start(), stop() and wait() are called by one thread; statistics() by any.
class Camera {
 public:
  virtual ~Camera() = default;
  /// Sets the camera up, for the external trigger where it has one, and streams. Throws InputError
  /// (unreachable, a setting refused or read back different), naming the camera and the setting.
  virtual void start() = 0;
  virtual void stop() = 0;  ///< idempotent
  /// The next whole frame, waiting until `deadline`; empty when none came.
  virtual std::optional<CameraFrame> wait(MonotonicInstant deadline) = 0;
  virtual CameraStatistics statistics() const = 0;
  /// The camera stopped answering; it must be started again.
  virtual bool lost() const = 0;
  virtual ImageSize size() const = 0;      ///< after start()
  virtual PixelFormat format() const = 0;  ///< after start()
};

}  // namespace v3d
