// A camera behind the kernel's V4L2: USB Video Class, frame grabbers, sensors on a board.
#pragma once

#include <atomic>
#include <memory>
#include <optional>

#include "base/config/studio_file.h"
#include "capture/cameras/camera.h"
#include "capture/cameras/v4l2_device.h"

namespace v3d {

/// Chosen by StudioCamera::address, a device path (take one of /dev/v4l/by-id/, which stays the
/// same). start() writes every setting and reads it back; a camera that has another value then is
/// refused. V4L2 has no standard for triggers: the studio file names the control that switches this
/// camera's trigger on. Without one it runs free, at the rate of run_free().
///
/// The device time is the host's CLOCK_MONOTONIC, stamped by the driver (another clock is refused)
/// at the start of the exposure or, by most drivers, at the end of the frame: later by a constant.
/// Every frame must say that it was stamped as the first one. A frame that the driver marks as
/// erroneous or that is too short is counted as damaged. After a disconnect, a fatal error of the
/// stream or a change of the time stamps the camera is lost(); stop() closes all of it.
class V4l2Camera : public Camera {
 public:
  explicit V4l2Camera(StudioCamera settings, V4l2Opener open = open_v4l2_device);
  ~V4l2Camera() override;

  /// For the next start(), of a camera without trigger control: refused when it has no such rate.
  void run_free(double rate_hz) { free_rate_hz_ = rate_hz; }

  void start() override;
  void stop() override;
  std::optional<CameraFrame> wait(MonotonicInstant deadline) override;
  CameraStatistics statistics() const override;
  bool lost() const override { return lost_; }
  ImageSize size() const override { return size_; }
  PixelFormat format() const override { return settings_.pixel_format; }

 private:
  class Stream;  ///< the open device and its buffers, from start() to stop()

  const StudioCamera settings_;
  const V4l2Opener open_;
  std::optional<double> free_rate_hz_;
  ImageSize size_;
  std::unique_ptr<Stream> stream_;
  std::optional<uint64_t> counter_;  ///< of the last frame
  std::atomic<int64_t> completed_ = 0;
  std::atomic<int64_t> damaged_ = 0;
  std::atomic<bool> lost_ = false;
};

}  // namespace v3d
