// Simulated camera with scripted faults. Its clock advances only in wait() and start().
#pragma once

#include <algorithm>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <utility>

#include "base/core/error.h"
#include "capture/cameras/camera.h"

namespace v3d::capture {

/// Pulses, faults and clock of one simulated camera. All times are on the clock `now`.
struct Script {
  static constexpr Duration kPeriod = std::chrono::milliseconds(40);
  static constexpr Duration kLatency = std::chrono::milliseconds(9);
  static constexpr uint8_t kStrayContent = 255;  ///< first pixel of a frame without a pulse

  MonotonicInstant now = from_ns<Monotonic>(5'000'000'000);

  // Pulse train; empty if there is none.
  std::optional<MonotonicInstant> train;
  int64_t pulses = 0;
  Duration period = kPeriod;

  Duration host_stalls{};  ///< the next wait() returns so late and without a frame; then 0

  // The camera.
  bool plugged = true;
  bool silent = false;                    ///< answers, but streams no frames
  bool free_running = false;              ///< knows the pulses of its frames
  std::optional<MonotonicInstant> stray;  ///< exposure without a pulse, once
  Duration opening_takes = std::chrono::milliseconds(0);
  Duration device_zero = std::chrono::hours(3);  ///< offset of the device clock from `now`
  uint64_t counter = 100;                        ///< of the next exposure
  std::set<int64_t> damaged;                     ///< pulses whose frames arrive damaged
  std::set<int64_t> vanished;                    ///< pulses whose frames are lost without a count
  std::set<int64_t> missed;                      ///< pulses that the camera does not detect
  std::optional<uint64_t> first_counter;         ///< Camera::first_counter()
  Duration shortest_period{};                    ///< for which it need not be started again
  Duration first_is_late{};                      ///< extra delay of the first frame after start()
  int opened = 0;                                ///< number of successful start() calls

  MonotonicInstant exposure(int64_t pulse) const { return *train + pulse * period; }
  void start_train(int64_t count) {
    train = now + std::chrono::milliseconds(3);
    pulses = count;
  }
};

class ScriptedCamera : public Camera {
 public:
  explicit ScriptedCamera(std::shared_ptr<Script> script) : script_(std::move(script)) {}

  void start() override {
    script_->now += script_->opening_takes;
    if (!script_->plugged) throw InputError("camera cam07: no answer");
    ++script_->opened;
    opened_at_ = script_->now;
  }
  void stop() override {}
  bool keeps_up_with(Duration period) const override { return period >= script_->shortest_period; }
  std::optional<uint64_t> first_counter() const override { return script_->first_counter; }

  std::optional<CameraFrame> wait(MonotonicInstant deadline) override {
    Script& s = *script_;
    if (s.host_stalls > Duration()) {
      s.now = deadline + std::exchange(s.host_stalls, {});
      return {};
    }
    if (s.stray && s.plugged && *s.stray + Script::kLatency <= deadline) return stray();
    while (s.train && s.plugged) {
      if (s.train != train_) {
        train_ = s.train;
        next_ = 0;
      }
      while (next_ < s.pulses && s.exposure(next_) < opened_at_) ++next_;
      const Duration latency = Script::kLatency + (first_ ? s.first_is_late : Duration());
      if (next_ >= s.pulses || s.exposure(next_) + latency > deadline) break;
      const int64_t pulse = next_++;
      s.now = std::max(s.now, s.exposure(pulse) + latency);
      if (s.silent || s.missed.contains(pulse)) continue;
      const uint64_t counter = s.counter++;
      if (s.vanished.contains(pulse)) continue;
      if (s.damaged.contains(pulse)) {
        ++statistics_.damaged;
        continue;
      }
      first_ = false;
      return frame_of(pulse, counter);
    }
    s.now = std::max(s.now, deadline);
    return {};
  }

  CameraStatistics statistics() const override { return statistics_; }
  bool lost() const override { return !script_->plugged; }
  ImageSize size() const override { return {4, 2}; }
  PixelFormat format() const override { return PixelFormat::kMono8; }

 private:
  /// A frame whose first pixel is `content`.
  CameraFrame frame(MonotonicInstant exposed, uint8_t content, uint64_t counter) {
    ++statistics_.completed;
    CameraFrame f;
    f.image = Image({4, 2}, PixelFormat::kMono8);
    f.image.bytes[0] = content;
    f.device_time =
        from_ns<DeviceClock>((exposed.time_since_epoch() + script_->device_zero).count());
    f.counter = counter;
    f.received = script_->now;
    return f;
  }
  /// The first pixel is the pulse number modulo 256.
  CameraFrame frame_of(int64_t pulse, uint64_t counter) {
    CameraFrame f = frame(script_->exposure(pulse), static_cast<uint8_t>(pulse), counter);
    if (script_->free_running) f.pulse = pulse;
    return f;
  }
  CameraFrame stray() {
    const MonotonicInstant exposed = *std::exchange(script_->stray, std::nullopt);
    script_->now = std::max(script_->now, exposed + Script::kLatency);
    return frame(exposed, Script::kStrayContent, script_->counter++);
  }

  std::shared_ptr<Script> script_;
  CameraStatistics statistics_;
  MonotonicInstant opened_at_{};
  std::optional<MonotonicInstant> train_;
  int64_t next_ = 0;
  bool first_ = true;
};

}  // namespace v3d::capture
