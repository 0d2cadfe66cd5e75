#include "capture/cameras/camera.h"

#include <algorithm>
#include <utility>

#include "base/core/error.h"
#include "capture/cameras/aravis_camera.h"
#include "capture/cameras/v4l2_camera.h"

namespace v3d::capture {

CameraStatistics operator+(const CameraStatistics& a, const CameraStatistics& b) {
  CameraStatistics sum = b;
  sum.completed += a.completed;
  sum.damaged += a.damaged;
  sum.underruns += a.underruns;
  sum.packets_resent += a.packets_resent;
  sum.packets_missing += a.packets_missing;
  return sum;
}

std::unique_ptr<Camera> make_camera(const StudioCamera& settings, const PulseTimes& pulses) {
  if (settings.kind == CameraKind::kAravis) return std::make_unique<AravisCamera>(settings);
  auto camera = std::make_unique<V4l2Camera>(settings);
  if (!settings.is_free_running()) {
    camera->set_rate(1 / to_seconds(pulses.period()));
    return camera;
  }
  V4l2Camera& borrowed = *camera;
  return std::make_unique<FreeRunningCamera>(
      std::move(camera), [&borrowed](double rate_hz) { borrowed.set_rate(rate_hz); }, pulses);
}

namespace {

constexpr Duration kMinSilence = std::chrono::seconds(1);
constexpr int kSilentPeriods = 3;
/// Interval at which a frame that waits for its pulse is checked.
constexpr Duration kPollPeriod = std::chrono::milliseconds(5);

}  // namespace

FreeRunningCamera::FreeRunningCamera(std::unique_ptr<Camera> camera, SetRate set_rate,
                                     const PulseTimes& pulses, Now now)
    : camera_(std::move(camera)),
      set_rate_(std::move(set_rate)),
      pulses_(pulses),
      now_(std::move(now)) {}

void FreeRunningCamera::start() {
  stop();
  lost_ = false;
  period_ = pulses_.period();
  set_rate_(1 / to_seconds(period_));
  camera_->start();
  last_ = now_();
}

void FreeRunningCamera::stop() {
  camera_->stop();
  held_.clear();
  phase_.reset();
}

/// Resets the phase at a new train, and restarts the camera if the pulse rate changed.
void FreeRunningCamera::follow_train() {
  const int64_t train = pulses_.trains();
  if (std::exchange(train_, train) != train) phase_.reset();
  if (pulses_.period() == period_) return;
  try {
    start();
  } catch (const InputError&) {
    lost_ = true;  // the next start() by the caller throws the same error
  }
}

std::optional<CameraFrame> FreeRunningCamera::wait(MonotonicInstant deadline) {
  while (true) {
    follow_train();
    if (lost()) break;
    if (auto frame = labelled()) return frame;
    if (now_() >= deadline) break;
    receive(deadline);
  }
  return {};
}

void FreeRunningCamera::receive(MonotonicInstant deadline) {
  const MonotonicInstant until =
      held_.empty() ? deadline : std::min(deadline, now_() + kPollPeriod);
  if (auto frame = camera_->wait(until)) {
    last_ = frame->received;
    held_.push_back(std::move(*frame));
  }
  lost_ = now_() - last_ > std::max<Duration>(kMinSilence, kSilentPeriods * period_);
}

std::optional<CameraFrame> FreeRunningCamera::labelled() {
  while (!held_.empty()) {
    const auto at = from_ns<Monotonic>(to_ns(held_.front().device_time));
    const auto place = pulses_.find(at, phase_, now_());
    if (!place) return {};
    CameraFrame frame = std::move(held_.front());
    held_.pop_front();
    if (place->phase) phase_ = place->phase;
    if (!place->pulse) continue;
    reported_phase_ = *place->phase;
    has_phase_ = true;
    frame.pulse = place->pulse;
    return frame;
  }
  return {};
}

CameraStatistics FreeRunningCamera::statistics() const {
  CameraStatistics statistics = camera_->statistics();
  if (has_phase_) statistics.phase = reported_phase_.load();
  return statistics;
}

}  // namespace v3d::capture
