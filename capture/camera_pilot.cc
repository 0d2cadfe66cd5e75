#include "capture/camera_pilot.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "base/error.h"

namespace v3d {
namespace {

constexpr int kQuietPeriods = 2;
constexpr int kSilentPeriods = 3;

CameraStatistics sum(const CameraStatistics& a, const CameraStatistics& b) {
  return {.completed = a.completed + b.completed,
          .damaged = a.damaged + b.damaged,
          .underruns = a.underruns + b.underruns,
          .packets_resent = a.packets_resent + b.packets_resent,
          .packets_missing = a.packets_missing + b.packets_missing};
}

}  // namespace

CameraPilot::CameraPilot(std::string camera, CameraWorker::Factory make_camera,
                         CameraWorkerOptions options)
    : name_(std::move(camera)),
      make_camera_(std::move(make_camera)),
      options_(std::move(options)) {}

void CameraPilot::arm(Duration period) {
  disarm();
  period_ = period;
  matcher_.emplace(period);
  last_frame_ = options_.now();
  counts_.frames = counts_.suspect = 0;
  counts_.last_pulse = -1;
}

void CameraPilot::disarm() {
  matcher_.reset();
  ready_ = begun_ = expecting_ = missing_ = false;
}

std::optional<Frame> CameraPilot::step() {
  if (!camera_) {
    if (options_.now() >= retry_at_) open();
    return {};
  }
  auto frame = camera_->wait(options_.now() + kLongestStep);
  if (!frame) {
    const MonotonicInstant now = options_.now();
    check_quiet(now);
    check_loss(now);
    return {};
  }
  last_frame_ = frame->received;
  Frame labelled;
  if (in_take()) labelled.label = label(*frame);
  last_counter_ = frame->counter;
  damaged_at_last_ = camera_->statistics().damaged;
  if (!in_take()) return {};
  labelled.camera = name_;
  labelled.sensor_size = frame->image.size;
  labelled.roi = {0, 0, frame->image.size.width, frame->image.size.height};
  labelled.image = std::move(frame->image);
  return labelled;
}

void CameraPilot::open() {
  try {
    camera_ = make_camera_();
    camera_->start();
    counts_.size = camera_->size();
    counts_.format = camera_->format();
    damaged_at_last_ = 0;
    if (!missing_) text_.clear();
  } catch (const InputError& error) {
    text_ = error.what();
    close();
    retry_at_ = options_.now() + options_.retry_after;
  }
  last_frame_ = options_.now();
}

void CameraPilot::close() {
  if (camera_) link_before_ = sum(link_before_, camera_->statistics());
  camera_.reset();
  last_counter_.reset();
}

void CameraPilot::check_quiet(MonotonicInstant now) {
  if (!matcher_ || ready_ || begun_ || now - last_frame_ < kQuietPeriods * period_) return;
  ready_ = true;
  missing_ = false;
  text_.clear();
  const int64_t damaged = camera_->statistics().damaged;
  if (last_counter_) matcher_->expect(*last_counter_ + 1 + (damaged - damaged_at_last_));
  damaged_at_last_ = damaged;
}

void CameraPilot::check_loss(MonotonicInstant now) {
  if (camera_->lost()) return reopen("stopped answering");
  const Duration silence = now - last_frame_;
  if (!expecting_ || silence < kSilentPeriods * period_) return;
  const auto ms = silence / std::chrono::milliseconds(1);
  miss("no frame for " + std::to_string(ms) + " ms");
  if (silence >= options_.reopen_after) reopen("no frame for " + std::to_string(ms) + " ms");
}

void CameraPilot::miss(const std::string& why) {
  if (missing_) return;
  missing_ = true;
  ++counts_.losses;
  text_ = "camera " + name_ + ": " + why;
}

void CameraPilot::reopen(const std::string& why) {
  miss(why);
  close();
  if (matcher_) matcher_->reopened();
  ready_ = false;  // a camera lost before the first pulse has to be quiet again
  retry_at_ = options_.now();
}

FrameLabel CameraPilot::label(const CameraFrame& frame) {
  if (!begun_) matcher_->broken_at_first(camera_->statistics().damaged - damaged_at_last_);
  const PulseMatch found = matcher_->label({frame.device_time, frame.counter, frame.received});
  if (!begun_) expecting_ = true;
  begun_ = true;
  missing_ = false;
  text_.clear();
  ++counts_.frames;
  counts_.suspect += found.suspect;
  counts_.last_pulse = std::max(counts_.last_pulse, found.pulse);

  FrameLabel label;
  label.pulse = found.pulse;
  label.suspect = found.suspect;
  label.camera_counter = frame.counter;
  label.device_time = frame.device_time;
  label.received = Realtime::now() - (options_.now() - frame.received);
  return label;
}

CameraState CameraPilot::state() const {
  if (missing_) return CameraState::kLost;
  if (!camera_) return CameraState::kOpening;
  if (!matcher_) return CameraState::kIdle;
  if (begun_) return CameraState::kRunning;
  return ready_ ? CameraState::kReady : CameraState::kSettling;
}

CameraWorkerStatus CameraPilot::status() const {
  CameraWorkerStatus status = counts_;
  status.text = text_;
  status.link = camera_ ? sum(link_before_, camera_->statistics()) : link_before_;
  status.state = state();
  return status;
}

}  // namespace v3d
