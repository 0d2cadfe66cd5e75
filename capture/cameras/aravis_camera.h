// A GigE Vision (or USB3 Vision) camera through Aravis.
#pragma once

#include <atomic>
#include <memory>

#include "base/config/studio_file.h"
#include "capture/cameras/camera.h"
#include "capture/cameras/frame_counter.h"

namespace v3d {

/// Chosen by StudioCamera::address: an IP address is asked directly; anything else is the serial
/// number, looked for on the network. start() takes control of the camera, writes every setting and
/// reads it back; a camera that has another value then is refused. With `ptp` it streams once its
/// clock is in step. With `chunk_data` frames carry the camera's own account of their exposure.
class AravisCamera : public Camera {
 public:
  explicit AravisCamera(StudioCamera settings);
  ~AravisCamera() override;

  void start() override;
  void stop() override;
  std::optional<CameraFrame> wait(MonotonicInstant deadline) override;
  CameraStatistics statistics() const override;
  bool lost() const override { return lost_; }
  ImageSize size() const override { return size_; }
  PixelFormat format() const override { return settings_.pixel_format; }

 private:
  class Link;  ///< the Aravis objects, from start() to stop()
  void read_statistics();
  void tell_ptp(std::optional<Duration> offset);

  const StudioCamera settings_;
  ImageSize size_;
  FrameCounter counter_;
  std::unique_ptr<Link> link_;
  std::atomic<int64_t> completed_ = 0;
  std::atomic<int64_t> damaged_ = 0;
  std::atomic<int64_t> underruns_ = 0;
  std::atomic<int64_t> packets_resent_ = 0;
  std::atomic<int64_t> packets_missing_ = 0;
  std::atomic<bool> has_ptp_offset_ = false;
  std::atomic<Duration> ptp_offset_ = Duration{};
  std::atomic<double> exposure_us_ = 0;  ///< of the last frame that told; 0: none has
  std::atomic<bool> lost_ = false;
};

}  // namespace v3d
