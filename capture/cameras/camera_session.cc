#include "capture/cameras/camera_session.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "base/core/error.h"

namespace v3d::capture {
namespace {

constexpr int kQuietPeriods = 2;
constexpr int kSilentPeriods = 3;
/// Held frames are delivered if no further frame arrives within this time, or within two periods.
constexpr Duration kMaxHold = std::chrono::milliseconds(300);
/// A step that took longer was not spent waiting.
constexpr Duration kMaxWait = 2 * CameraSession::kMaxStep;
/// Number of frames of a train that measure the latency: few enough for the clock not to drift.
constexpr size_t kLatencyFrames = 2 * kStartFrames;

}  // namespace

CameraSession::CameraSession(std::string camera, CameraWorker::Factory make_camera,
                             CameraWorkerOptions options)
    : name_(std::move(camera)),
      make_camera_(std::move(make_camera)),
      options_(std::move(options)) {}

void CameraSession::arm(Duration period, bool edges_are_reported) {
  disarm();
  if (camera_ && !camera_->keeps_up_with(period)) close();
  period_ = period;
  matcher_.emplace(period);
  start_ = {.period = period, .latency = latency_};
  edges_are_reported_ = edges_are_reported;
  reset_silence(options_.now());
  latency_frames_ = 0;
  counts_.frames = counts_.suspect = 0;
  counts_.last_pulse = -1;
}

void CameraSession::rejoin(Duration period, bool edges_are_reported,
                           const CameraResumeState& past) {
  arm(period, edges_are_reported);
  joins_late_ = ready_ = expecting_ = true;
  resumes_take_ = !past.frames.empty();
  if (resumes_take_) {
    matcher_->resume_from(past.frames);
    counts_.last_pulse = past.frames.back().pulse;
  }
  latency_ = start_.latency = past.latency;
  counts_.frames = past.delivered;
  counts_.suspect = past.suspect;
}

void CameraSession::disarm() {
  if (camera_) text_.clear();
  matcher_.reset();
  held_.clear();
  strays_.clear();
  labelled_.clear();
  ready_ = running_ = expecting_ = missing_ = joins_late_ = resumes_take_ = false;
  train_is_over_ = was_ready_ = false;
  unquiet_frames_ = 0;
}

void CameraSession::train_ended() {
  train_is_over_ = true;
  expecting_ = false;
}

void CameraSession::pulse_at(const PulseEdge& edge) {
  if (!matcher_) return;
  if (!ready_ && was_ready_) join_late();
  if (!ready_) return;
  if (running_) return expect_after(edge);
  if (!train_is_over_ && !std::exchange(expecting_, true)) {
    reset_silence(std::max(last_frame_, edge.is_timed ? edge.at : options_.now()));
  }
  if (edge.is_timed) start_.edge = edge;
}

std::optional<Frame> CameraSession::step() {
  if (!held_.empty()) label_first_frames(false);
  if (labelled_.empty()) advance();
  if (labelled_.empty()) return {};
  Frame frame = std::move(labelled_.front());
  labelled_.pop_front();
  return frame;
}

void CameraSession::advance() {
  if (!camera_) {
    if (options_.now() >= retry_at_) open();
    return;
  }
  if (auto frame = camera_->wait(wait_deadline())) return receive(std::move(*frame));
  observe_silence();
  check_quiet();
  check_loss();
}

void CameraSession::reset_silence(MonotonicInstant at) {
  last_frame_ = at;
  silence_ = {};
}

/// A thread that did not run for a while has not waited for that long, and frames may be waiting
/// for it.
void CameraSession::observe_silence() {
  const MonotonicInstant now = options_.now();
  silence_ += std::clamp<Duration>(now - std::max(checked_, last_frame_), {}, kMaxWait);
  checked_ = now;
}

/// Time until which step() waits for a frame: at most one step, and not beyond the time at which a
/// silent camera counts as lost.
MonotonicInstant CameraSession::wait_deadline() const {
  const Duration step = matcher_ ? kMaxStep : kIdleStep;
  const Duration until_lost = kSilentPeriods * period_ - silence_;
  return options_.now() +
         (expecting_ && until_lost > Duration() ? std::min(until_lost, step) : step);
}

void CameraSession::receive(CameraFrame frame) {
  reset_silence(frame.received);
  last_counter_ = frame.counter;
  const int64_t damaged = camera_->statistics().damaged;
  const int64_t new_damaged = damaged - std::exchange(damaged_at_last_, damaged);
  if (!in_take() && was_ready_ && !edges_are_reported_ && ++unquiet_frames_ >= kStartFrames) {
    join_late();  // that many in succession are of pulses
  }
  if (!in_take()) return;
  missing_ = false;
  text_.clear();
  running_ = running_ || frame.pulse;
  if (running_) {
    if (frame.pulse) expect_frames();
    const PulseMatch found = match(frame);
    deliver(std::move(frame), found);
    return deliver_strays();
  }
  if (!edges_are_reported_) expect_frames();
  if (held_.empty() && !joins_late_) start_.damaged = new_damaged;
  held_.push_back(std::move(frame));
  label_first_frames(!edges_are_reported_);
}

void CameraSession::open() {
  try {
    camera_ = make_camera_();
    camera_->start();
    counts_.size = camera_->size();
    counts_.format = camera_->format();
    counts_.device = camera_->device();
    counts_.differences = camera_->differences();
    damaged_at_last_ = 0;
    if (!matcher_) missing_ = false;  // in a take, a quiet time or a frame proves that it is back
    if (!missing_) text_.clear();
  } catch (const InputError& error) {
    text_ = error.what();
    close();
    retry_at_ = options_.now() + options_.retry_after;
  }
  reset_silence(options_.now());
}

void CameraSession::close() {
  if (camera_) link_before_ = link_before_ + camera_->statistics();
  camera_.reset();
  last_counter_.reset();
  start_.counter_of_pulse_0.reset();
  start_.first_counter.reset();
}

void CameraSession::check_quiet() {
  if (!matcher_ || ready_ || running_ || silence_ < kQuietPeriods * period_) return;
  ready_ = was_ready_ = true;
  missing_ = false;
  text_.clear();
  const int64_t damaged = camera_->statistics().damaged;
  const auto new_damaged = static_cast<uint64_t>(damaged - damaged_at_last_);
  if (last_counter_) {
    start_.counter_of_pulse_0 = *last_counter_ + 1 + new_damaged;
  } else if (const auto first = camera_->first_counter()) {
    start_.first_counter = *first + new_damaged;
  }
  damaged_at_last_ = damaged;
}

/// The take has this camera, and pulses began before it was open again: it is never quiet.
void CameraSession::join_late() { joins_late_ = ready_ = true; }

void CameraSession::check_loss() {
  if (camera_->lost()) return reopen("stopped answering");
  const Duration max_hold =
      std::min<Duration>(kSilentPeriods * period_, std::max<Duration>(kMaxHold, 2 * period_));
  if (!held_.empty() && pulses_have_begun() && silence_ >= max_hold) label_first_frames(true);
  if (train_is_over_ && silence_ >= max_hold) deliver_strays();
  if (!expecting_ || silence_ < kSilentPeriods * period_) return;
  const std::string why = "no frame for " + std::to_string(kSilentPeriods) + " pulses";
  report_missing(why);
  if (silence_ >= options_.reopen_after) reopen(why);
}

void CameraSession::report_missing(const std::string& why) {
  if (missing_) return;
  missing_ = true;
  ++counts_.losses;
  text_ =
      why + (counts_.last_pulse < 0 ? "" : " after pulse " + std::to_string(counts_.last_pulse));
  counts_.last_loss = text_;
}

void CameraSession::reopen(const std::string& why) {
  if (!held_.empty() && pulses_have_begun()) label_first_frames(true);
  set_aside(held_.size());
  report_missing(why);
  close();
  if (matcher_) matcher_->reopened();
  // A camera that was lost before the first pulse must be quiet again, unless pulses begin first.
  // Later, the times of the pulses identify the first frame.
  if (!start_.edge && !joins_late_) ready_ = false;
  unquiet_frames_ = 0;
  retry_at_ = options_.now();
}

std::vector<FrameStamp> CameraSession::held_stamps() const {
  std::vector<FrameStamp> stamps;
  for (const CameraFrame& frame : held_) {
    stamps.push_back({frame.device_time, frame.counter, frame.received});
  }
  return stamps;
}

/// First frames after a restart in a take: the times of reported pulses predict the arrival of
/// frames, however long the interruption was. So the frames wait for the first report, which may
/// need a while, as long as memory allows.
void CameraSession::label_resumed_frames(bool no_more) {
  const bool is_known = start_.edge && latency_;
  const bool may_wait =
      edges_are_reported_ && latency_ && !no_more && held_.size() < kMaxStartFrames;
  if (!is_known && may_wait) return;
  if (is_known) matcher_->expect(start_.edge->pulse, start_.edge->at + *latency_);
  running_ = true;
  expect_frames();
  deliver_held(0);
}

/// A pulse that is reported after the first frames of a resumed take were delivered: without it,
/// the matcher would extrapolate the arrivals of before the interruption, and could suspect all
/// frames.
void CameraSession::expect_after(const PulseEdge& edge) {
  if (!edge.is_timed || !latency_ || !is_resuming()) return;
  start_.edge = edge;
  matcher_->expect(edge.pulse, edge.at + *latency_);
}

void CameraSession::label_first_frames(bool no_more) {
  if (!pulses_have_begun()) {
    if (held_.size() < kStartFrames) return;
    // That many in succession are of pulses whose reports were lost.
    if (held_.back().received - held_.front().received > 2 * kStartFrames * period_) {
      return set_aside(1);
    }
  }
  if (resumes_take_) return label_resumed_frames(no_more);
  const auto start = find_start(held_stamps(), start_, no_more);
  if (!start) return;
  running_ = true;
  expect_frames();
  // Without the time of a pulse, nothing shows how many pulses were before a late first frame.
  matcher_->begin(start->pulse, start->certain && (start_.edge || !joins_late_));
  deliver_held(start->strays);
}

/// Delivers all held frames but the first `strays`, which belong to no pulse.
void CameraSession::deliver_held(size_t strays) {
  set_aside(strays);
  if (held_.empty()) return;
  for (; !held_.empty(); held_.pop_front()) {
    const PulseMatch found = match(held_.front());
    deliver(std::move(held_.front()), found);
  }
  deliver_strays();
}

/// Removes the first `count` held frames: they were exposed before the pulses. The last ones of all
/// are kept.
void CameraSession::set_aside(size_t count) {
  for (; count > 0; --count) {
    if (start_.counter_of_pulse_0) start_.counter_of_pulse_0 = held_.front().counter + 1;
    if (start_.first_counter) start_.first_counter = held_.front().counter + 1;
    strays_.push_back(std::move(held_.front()));
    held_.pop_front();
    if (strays_.size() > kStartFrames) strays_.pop_front();
  }
}

/// Delivers the strays, as suspect frames of pulse 0. The frame of pulse 0 must come first, because
/// readers take the first frame of a pulse.
void CameraSession::deliver_strays() {
  for (; !strays_.empty(); strays_.pop_front()) deliver(std::move(strays_.front()), {0, true});
}

PulseMatch CameraSession::match(const CameraFrame& frame) {
  if (frame.pulse) return {.pulse = *frame.pulse};
  const PulseMatch found = matcher_->label({frame.device_time, frame.counter, frame.received});
  if (!found.suspect) learn_latency(found.pulse, frame.received);
  return found;
}

void CameraSession::learn_latency(int64_t pulse, MonotonicInstant received) {
  if (!start_.edge || start_.edge->may_be_early || latency_frames_ == kLatencyFrames) return;
  const Duration latency = latency_of(received, pulse, *start_.edge, period_);
  min_latency_ = latency_frames_ == 0 ? latency : std::min(min_latency_, latency);
  if (++latency_frames_ >= kStartFrames)
    latency_ = std::min(latency_.value_or(latency), min_latency_);
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
  if (running_) return CameraState::kRunning;
  return ready_ ? CameraState::kReady : CameraState::kSettling;
}

CameraWorkerStatus CameraSession::status() const {
  CameraWorkerStatus status = counts_;
  status.text = text_;
  status.link = camera_ ? link_before_ + camera_->statistics() : link_before_;
  status.state = state();
  status.is_resuming = is_resuming();
  return status;
}

}  // namespace v3d::capture
