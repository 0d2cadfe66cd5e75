// Camera backend for GigE Vision and USB3 Vision, based on Aravis.
#pragma once

#include <atomic>
#include <memory>

#include "base/config/studio_file.h"
#include "capture/cameras/camera.h"
#include "capture/cameras/frame_counter.h"

namespace v3d {

/// StudioCamera::address selects the camera: an IP address is opened directly; any other text is a
/// serial number, for which start() searches the network. start() takes control of the camera,
/// writes every setting and reads it back. It throws InputError if a value differs. With `ptp` the
/// camera streams after its clock is synchronised. With `chunk_data` each frame carries the
/// exposure time that the camera measured.
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
  class Link;  ///< the Aravis objects; exists from start() to stop()
  void read_statistics();
  void store_ptp_offset(std::optional<Duration> offset);

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
  std::atomic<double> exposure_us_ = 0;  ///< of the last frame that reported it; 0: none did
  std::atomic<bool> lost_ = false;
};

}  // namespace v3d
