// Aravis camera and its frame counter.
#pragma once

#include <atomic>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "base/config/studio_file.h"
#include "capture/cameras/camera.h"

namespace v3d::capture {

// Unwraps the frame numbers of a camera to 64 bits.

/// GigE Vision 1 numbers blocks with 16 bits and skips 0: 1 follows 65535. GigE Vision 2 and USB3
/// Vision number with 64 bits. A number above 65535 shows that the camera uses 64 bits. Unwrapped
/// numbers are one period (65535) larger than the camera's, so that an earlier frame has a number.
///
/// Requires that fewer than half a period (32767 frames) are lost in a row, and that frames are out
/// of order by at most as many. Not thread-safe.
class FrameCounter {
 public:
  uint64_t unwrap(uint64_t number) {
    if (number > kPeriod) is_64_bit_ = true;
    if (is_64_bit_) return kPeriod + number;
    if (started_) {
      last_ += shortest_step(number);
    } else {
      last_ = kPeriod + number;  // one period ahead: a frame before this one gets a number, too
    }
    started_ = true;
    return last_;
  }

 private:
  static constexpr int64_t kPeriod = 65535;  ///< 16-bit numbers run from 1 to 65535

  /// Smallest signed difference from the last number to this one, modulo kPeriod.
  int64_t shortest_step(uint64_t number) const {
    const int64_t step = static_cast<int64_t>(number) - static_cast<int64_t>(last_ % kPeriod);
    const int64_t half = kPeriod / 2;
    return (step + half + kPeriod) % kPeriod - half;
  }

  uint64_t last_ = 0;
  bool started_ = false;
  bool is_64_bit_ = false;
};

// Camera backend for GigE Vision and USB3 Vision, based on Aravis.

/// StudioCamera::address selects the camera: an IP address is opened directly; any other text is a
/// serial number, for which start() searches the network. start() takes control of the camera,
/// writes every setting and reads it back. It throws InputError if a value differs, except for
/// those in differences(). With `ptp` the
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
  PixelFormat format() const override { return settings_.pixel_format.image; }
  CameraDevice device() const override;
  std::optional<uint64_t> first_counter() const override;
  std::vector<SettingDifference> differences() const override;

 private:
  class Link;  ///< the Aravis objects; exists from start() to stop()
  void read_statistics();
  static constexpr double kNoTemperature = -1000;
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
  std::atomic<bool> ptp_locked_ = false;
  std::atomic<double> exposure_us_ = 0;  ///< of the last frame that reported it; 0: none did
  std::atomic<double> temperature_celsius_ = kNoTemperature;
  std::atomic<bool> lost_ = false;
};

}  // namespace v3d::capture
