// V4L2 camera and its device.
#pragma once

#include <linux/videodev2.h>

#include <atomic>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "base/config/studio_file.h"
#include "base/core/time.h"
#include "capture/cameras/camera.h"
#include "capture/cameras/pixel_decoder.h"

namespace v3d::capture {

// Interface to a V4L2 device file. Tests replace the kernel through it.

/// An open device file /dev/videoN. Not thread-safe. The destructor closes it and unmaps all
/// buffers.
class V4l2Device {
 public:
  virtual ~V4l2Device() = default;
  /// Calls ioctl(2), again after EINTR. Returns 0 or an errno.
  virtual int control(unsigned long request, void* argument) = 0;
  /// Waits until a buffer is available or the device reports an error. False if neither happened
  /// before `deadline`.
  virtual bool wait(MonotonicInstant deadline) = 0;
  /// Maps a buffer of the driver (mmap). Empty, with errno set, on failure.
  virtual std::span<const uint8_t> map(size_t bytes, uint32_t offset) = 0;
};

/// Opens a device file. Null, with errno set, on failure.
using V4l2Opener = std::function<std::unique_ptr<V4l2Device>(const std::string& path)>;
std::unique_ptr<V4l2Device> open_v4l2_device(const std::string& path);

// Camera backend for Linux V4L2: USB Video Class, frame grabbers, on-board sensors.

/// StudioCamera::address is a device path, a serial number or a bus path (v4l2_device()).
/// start() writes every setting and reads it back. It throws InputError if a value differs. It
/// switches off every control with which a camera changes its pictures by itself; differences()
/// names those that the camera ignores. V4L2 has no standard for triggers: the studio file names
/// the control that switches the trigger on. Without one the camera runs free, at the rate set by
/// set_rate().
///
/// Packed samples become samples of 16 bits, and YUV and JPEG become RGB8 (pixel_decoder.h),
/// because all other layers process samples and RGB only.
///
/// The device time is the driver's time stamp, of the host's CLOCK_MONOTONIC; start() rejects
/// another clock. Drivers take it at the start of the exposure or, mostly, at the end of the frame:
/// later by a constant. All frames must be stamped in the same way. A frame that is too short, or
/// that the driver marks as erroneous, counts as damaged. After a disconnect, a fatal stream error
/// or a change of the time stamps the camera is lost(). stop() closes the device.
class V4l2Camera : public Camera {
 public:
  explicit V4l2Camera(StudioCamera settings, V4l2Opener open = open_v4l2_device);
  ~V4l2Camera() override;

  /// Sets the rate of the pulses, Hz, for the next start(). A camera without trigger control runs
  /// at this rate, and start() throws InputError if it cannot. One with a trigger control gets a
  /// frame interval that is not longer than the period; differences() has a longer one.
  void set_rate(double rate_hz) { rate_hz_ = rate_hz; }

  void start() override;
  void stop() override;
  std::optional<CameraFrame> wait(MonotonicInstant deadline) override;
  CameraStatistics statistics() const override;
  bool lost() const override { return lost_; }
  ImageSize size() const override { return size_; }
  PixelFormat format() const override { return settings_.pixel_format.image; }
  CameraDevice device() const override;
  bool keeps_up_with(Duration period) const override;
  std::vector<SettingDifference> differences() const override;

 private:
  class Stream;  ///< the open device and its buffers; exists from start() to stop()

  const StudioCamera settings_;
  const V4l2Opener open_;
  std::optional<double> rate_hz_;
  ImageSize size_;
  std::unique_ptr<Stream> stream_;
  std::optional<uint64_t> counter_;  ///< of the last frame
  std::atomic<int64_t> completed_ = 0;
  std::atomic<int64_t> damaged_ = 0;
  std::atomic<bool> lost_ = false;
};

}  // namespace v3d::capture

namespace v3d::capture::v4l2 {

// Writes the settings of the studio file to a V4L2 camera. For capture/cameras/v4l2_camera.cc only.

/// Settings that a camera has after write_settings().
struct Applied {
  SentLayout layout;
  std::string device;  ///< name of the device and its driver
  /// Automatic controls that stay on, controls of [camera.features] with another value, an exposure
  /// time that was rounded to the steps of V4L2, and a frame interval that is longer than the
  /// period of the pulses.
  std::vector<SettingDifference> differences;
  /// Of a triggered camera with a frame interval: the rate of pulses, Hz, above which the settings
  /// must be written again.
  std::optional<double> trigger_rate_hz;
};

/// Whether a camera with the frame rate `got_hz` can follow pulses of `hz`.
bool is_fast_enough(double got_hz, double hz);

/// Writes all settings and reads them back. Switches every automatic control off first. Sets the
/// frame interval by `rate_hz`, the rate of the pulses (empty: unknown):
///   - without a trigger control, the camera must run at this rate;
///   - with a trigger control, it becomes the longest interval that is not longer than the period,
///     because many drivers bound exposure and rate by it. No frame interval is no fault.
/// Throws InputError (see fail()) if a value of the studio file differs afterwards.
Applied write_settings(const StudioCamera& settings, std::optional<double> rate_hz,
                       V4l2Device& device);

/// Calls device.control(). Throws InputError (see fail()) on an error.
void control_or_throw(const StudioCamera& settings, V4l2Device& device, const std::string& what,
                      unsigned long request, void* argument);

/// Throws InputError such as "camera cam07: size: expected 640x480, found 320x240".
[[noreturn]] void fail(const StudioCamera& settings, const std::string& what,
                       const std::string& wanted, const std::string& got);

}  // namespace v3d::capture::v4l2
