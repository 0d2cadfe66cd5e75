// A camera that delivers the frames of a test, on the real clock.
#pragma once

#include <condition_variable>
#include <deque>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <thread>
#include <utility>

#include "capture/cameras/camera.h"

namespace v3d::capture {

/// Frames that the test passes to a camera on the real clock.
struct FrameSource {
  std::mutex mutex;
  std::condition_variable changed;
  std::deque<CameraFrame> frames;
  uint64_t counter = 0;
  ImageSize size{4, 2};

  void expose() {
    const std::lock_guard lock(mutex);
    CameraFrame frame;
    frame.image = Image(size, PixelFormat::kMono8);
    frame.counter = ++counter;
    frame.device_time = from_ns<DeviceClock>(static_cast<int64_t>(counter) * 1'000'000);
    frame.received = Monotonic::now();
    frames.push_back(std::move(frame));
    changed.notify_all();
  }
};

class FedCamera : public Camera {
 public:
  explicit FedCamera(std::shared_ptr<FrameSource> source) : source_(std::move(source)) {}
  void start() override {}
  void stop() override {}
  std::optional<CameraFrame> wait(MonotonicInstant deadline) override {
    std::unique_lock lock(source_->mutex);
    source_->changed.wait_for(lock, deadline - Monotonic::now(),
                              [&] { return !source_->frames.empty(); });
    if (source_->frames.empty()) return {};
    CameraFrame frame = std::move(source_->frames.front());
    source_->frames.pop_front();
    return frame;
  }
  CameraStatistics statistics() const override { return {}; }
  bool lost() const override { return false; }
  ImageSize size() const override { return source_->size; }
  PixelFormat format() const override { return PixelFormat::kMono8; }

 private:
  std::shared_ptr<FrameSource> source_;
};

inline bool eventually(const std::function<bool()>& condition) {
  const auto deadline = Monotonic::now() + std::chrono::seconds(20);
  while (!condition()) {
    if (Monotonic::now() > deadline) return false;
    std::this_thread::yield();
  }
  return true;
}

}  // namespace v3d::capture
