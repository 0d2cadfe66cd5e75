#include "capture/cameras/camera_session.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "base/core/error.h"

namespace v3d {
namespace {

constexpr int kQuietPeriods = 2;
constexpr int kSilentPeriods = 3;
/// Frames that are held back go on their way when no more follow for so long after the train.
constexpr Duration kLongestHold = std::chrono::milliseconds(300);
/// Frames of a train that the latency is learnt from: so few that its clock cannot have drifted.
constexpr size_t kLatencyFrames = 2 * kStartFrames;

}  // namespace

CameraSession::CameraSession(std::string camera, CameraWorker::Factory make_camera,
                             CameraWorkerOptions options)
    : name_(std::move(camera)),
      make_camera_(std::move(make_camera)),
      options_(std::move(options)) {}

void CameraSession::arm(Duration period, bool edges_are_told) {
  disarm();
  period_ = period;
  matcher_.emplace(period);
  start_ = {.period = period, .latency = latency_};
  edges_are_told_ = edges_are_told;
  last_frame_ = options_.now();
  punctual_ = 0;
  counts_.frames = counts_.suspect = 0;
  counts_.last_pulse = -1;
}

void CameraSession::rejoin(Duration period, bool edges_are_told, const CameraResumeState& past) {
  arm(period, edges_are_told);
  joins_late_ = ready_ = expecting_ = true;
  goes_on_ = !past.frames.empty();
  if (goes_on_) {
    matcher_->go_on_from(past.frames);
    counts_.last_pulse = past.frames.back().pulse;
  }
  latency_ = start_.latency = past.latency;
  counts_.frames = past.delivered;
  counts_.suspect = past.suspect;
}

void CameraSession::disarm() {
  matcher_.reset();
  held_.clear();
  labelled_.clear();
  ready_ = begun_ = expecting_ = missing_ = joins_late_ = goes_on_ = false;
}

void CameraSession::pulse_at(const PulseEdge& edge) {
  if (!matcher_ || begun_ || !ready_) return;
  if (!start_.edge) {
    expecting_ = true;
    last_frame_ = std::max(last_frame_, edge.at);
  }
  start_.edge = edge;
}

std::optional<Frame> CameraSession::step() {
  if (!held_.empty()) begin(false);
  if (labelled_.empty()) go_on();
  if (labelled_.empty()) return {};
  Frame frame = std::move(labelled_.front());
  labelled_.pop_front();
  return frame;
}

void CameraSession::go_on() {
  if (!camera_) {
    if (options_.now() >= retry_at_) open();
    return;
  }
  if (auto frame = camera_->wait(next_look())) return hear(std::move(*frame));
  const MonotonicInstant now = options_.now();
  check_quiet(now);
  check_loss(now);
}

/// A loss is noticed when it is due.
MonotonicInstant CameraSession::next_look() const {
  const MonotonicInstant now = options_.now();
  const MonotonicInstant latest = now + (matcher_ ? kLongestStep : kIdleStep);
  const MonotonicInstant lost_at = last_frame_ + kSilentPeriods * period_;
  return expecting_ && lost_at > now ? std::min(lost_at, latest) : latest;
}

void CameraSession::hear(CameraFrame frame) {
  last_frame_ = frame.received;
  last_counter_ = frame.counter;
  const int64_t damaged = camera_->statistics().damaged;
  const int64_t broken = damaged - std::exchange(damaged_at_last_, damaged);
  if (!in_take()) return;
  missing_ = false;
  text_.clear();
  begun_ = begun_ || frame.pulse;
  if (begun_) {
    if (frame.pulse) expecting_ = true;
    const PulseMatch found = match(frame);
    return deliver(std::move(frame), found);
  }
  expecting_ = true;
  if (held_.empty() && !joins_late_) start_.broken = broken;
  held_.push_back(std::move(frame));
  begin(!edges_are_told_);
}

void CameraSession::open() {
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

void CameraSession::close() {
  if (camera_) link_before_ = link_before_ + camera_->statistics();
  camera_.reset();
  last_counter_.reset();
  start_.counter_of_pulse_0.reset();
}

void CameraSession::check_quiet(MonotonicInstant now) {
  if (!matcher_ || ready_ || begun_ || now - last_frame_ < kQuietPeriods * period_) return;
  ready_ = true;
  missing_ = false;
  text_.clear();
  const int64_t damaged = camera_->statistics().damaged;
  if (last_counter_) start_.counter_of_pulse_0 = *last_counter_ + 1 + (damaged - damaged_at_last_);
  damaged_at_last_ = damaged;
}

void CameraSession::check_loss(MonotonicInstant now) {
  if (camera_->lost()) return reopen("stopped answering");
  const Duration silence = now - last_frame_;
  if (!held_.empty() && silence >= std::min<Duration>(kSilentPeriods * period_, kLongestHold)) {
    begin(true);
  }
  if (!expecting_ || silence < kSilentPeriods * period_) return;
  const std::string why = "no frame for " + std::to_string(kSilentPeriods) + " pulses";
  miss(why);
  if (silence >= options_.reopen_after) reopen(why);
}

void CameraSession::miss(const std::string& why) {
  if (missing_) return;
  missing_ = true;
  ++counts_.losses;
  text_ =
      why + (counts_.last_pulse < 0 ? "" : " after pulse " + std::to_string(counts_.last_pulse));
  counts_.last_loss = text_;
}

void CameraSession::reopen(const std::string& why) {
  if (!held_.empty()) begin(true);
  miss(why);
  close();
  if (matcher_) matcher_->reopened();
  // A camera lost before the first pulse has to be quiet again; afterwards the pulses tell.
  if (!start_.edge && !joins_late_) ready_ = false;
  retry_at_ = options_.now();
}

std::vector<FrameStamp> CameraSession::held_stamps() const {
  std::vector<FrameStamp> stamps;
  for (const CameraFrame& frame : held_) {
    stamps.push_back({frame.device_time, frame.counter, frame.received});
  }
  return stamps;
}

/// A take goes on: the pulses that are heard of tell when frames arrive, whatever the time between.
void CameraSession::begin_late(bool no_more) {
  const bool knows = start_.edge && start_.edge->is_timed && latency_;
  const bool may_learn = edges_are_told_ && latency_ && !no_more && held_.size() < kStartFrames;
  if (!knows && may_learn) return;
  if (knows) matcher_->expect(start_.edge->pulse, start_.edge->at + *latency_);
  begun_ = true;
  deliver_held(0);
}

void CameraSession::begin(bool no_more) {
  if (goes_on_) return begin_late(no_more);
  const auto start = find_start(held_stamps(), start_, no_more);
  if (!start) return;
  begun_ = true;
  matcher_->begin(start->pulse, start->certain);
  deliver_held(start->strays);
}

/// `strays`: so many at the front are of no pulse.
void CameraSession::deliver_held(size_t strays) {
  for (size_t i = 0; !held_.empty(); ++i) {
    CameraFrame frame = std::move(held_.front());
    held_.pop_front();
    const PulseMatch found = i < strays ? PulseMatch{0, true} : match(frame);
    deliver(std::move(frame), found);
  }
}

PulseMatch CameraSession::match(const CameraFrame& frame) {
  if (frame.pulse) return {.pulse = *frame.pulse};
  const PulseMatch found = matcher_->label({frame.device_time, frame.counter, frame.received});
  if (!found.suspect) learn_latency(found.pulse, frame.received);
  return found;
}

void CameraSession::learn_latency(int64_t pulse, MonotonicInstant received) {
  if (!start_.edge || punctual_ == kLatencyFrames) return;
  const Duration latency = latency_of(received, pulse, *start_.edge, period_);
  least_latency_ = punctual_ == 0 ? latency : std::min(least_latency_, latency);
  if (++punctual_ >= kStartFrames) latency_ = std::min(latency_.value_or(latency), least_latency_);
}

void CameraSession::deliver(CameraFrame frame, PulseMatch match) {
  ++counts_.frames;
  counts_.suspect += match.suspect;
  counts_.last_pulse = std::max(counts_.last_pulse, match.pulse);

  Frame labelled;
  labelled.camera = name_;
  labelled.label.pulse = match.pulse;
  labelled.label.suspect = match.suspect;
  labelled.label.camera_counter = frame.counter;
  labelled.label.device_time = frame.device_time;
  labelled.label.received = Realtime::now() - (options_.now() - frame.received);
  labelled.sensor_size = frame.image.size;
  labelled.roi = {0, 0, frame.image.size.width, frame.image.size.height};
  labelled.image = std::move(frame.image);
  labelled_.push_back(std::move(labelled));
}

CameraState CameraSession::state() const {
  if (missing_) return CameraState::kLost;
  if (!camera_) return CameraState::kOpening;
  if (!matcher_) return CameraState::kIdle;
  if (begun_) return CameraState::kRunning;
  return ready_ ? CameraState::kReady : CameraState::kSettling;
}

CameraWorkerStatus CameraSession::status() const {
  CameraWorkerStatus status = counts_;
  status.text = text_;
  status.link = camera_ ? link_before_ + camera_->statistics() : link_before_;
  status.state = state();
  return status;
}

}  // namespace v3d
