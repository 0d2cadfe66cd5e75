#include "capture/sync/pulse_matcher.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace v3d::capture {
namespace {

constexpr double kStampJitter = 0.05;        ///< standard deviation, periods
constexpr double kMaxResidual = 0.21;        ///< periods
constexpr double kMaxStepError = 0.25;       ///< periods, between two frames
constexpr double kMaxStddev = 0.15;          ///< standard deviation of the fit, periods
constexpr double kArrivalJitter = 0.1;       ///< standard deviation, periods
constexpr double kMaxArrivalResidual = 0.4;  ///< periods, of a frame that is not late
constexpr double kMaxArrivalStddev = 0.2;    ///< standard deviation of the fit, periods
constexpr double kMaxDelay = 1000;           ///< periods; no frame is delayed by more
constexpr double kMaxDelayAfterReopen = 10;  ///< periods; a host that opens a camera is busy
constexpr int64_t kMaxEqualDelay = 10;       ///< periods; frames in a row may be equally late
constexpr int kConfirmationsOfTwo = 1;       ///< confirmations if two of three sources agree
constexpr int kConfirmationsOfArrival = 8;   ///< confirmations if only the arrival counts
constexpr int kMaxStragglers = 3;            ///< frames in a row
constexpr double kDelayJump = 2;             ///< periods
constexpr double kMaxDeviations = 4;         ///< standard deviations

}  // namespace

PulseMatcher::PulseMatcher(Duration period)
    : fit_(period, kStampJitter), arrivals_(period, kArrivalJitter) {}

PulseMatch PulseMatcher::label(const FrameStamp& frame) {
  if (!is_started()) return first(frame);
  const Evidence e = evaluate(frame);
  if (resumed_ && !resumed_stddev_ && e.clock_pulse > last_pulse_) {
    resumed_stddev_ = fit_.stddev(e.clock_pulse);
  }
  if (!is_consistent(e)) return handle_inconsistent(e, frame);
  // The frame is a duplicate or late. Several of them in a row mean that the camera restarted and
  // repeats earlier counter values. So does a jump of the delay after such a frame.
  if (e.clock_pulse <= last_pulse_) {
    unreliable_ = ++stragglers_ >= kMaxStragglers;
    return handle_inconsistent(e, frame);
  }
  const double late = e.by_arrival - static_cast<double>(e.clock_pulse);
  if (stragglers_ > 0 && late - delay_ > kDelayJump) return handle_inconsistent(e, frame);
  return accept(e.clock_pulse, frame);
}

PulseMatch PulseMatcher::first(const FrameStamp& frame) {
  resynchronise(last_pulse_, frame);
  arrivals_.begin(last_pulse_, to_ns(frame.received));
  return {last_pulse_, start_uncertain_};
}

void PulseMatcher::resume_from(std::span<const KnownFrame> frames) {
  begin(frames.front().pulse, true);
  first(frames.front().stamp);
  for (const KnownFrame& frame : frames.subspan(1)) accept(frame.pulse, frame.stamp);
  reopened_ = resumed_ = true;
}

void PulseMatcher::expect(int64_t pulse, MonotonicInstant arrival) {
  const int64_t at = to_ns(arrival);
  const double earlier =
      arrivals_.is_started() ? arrivals_.pulse_at(at) - static_cast<double>(pulse) : 0;
  if (std::abs(earlier) > kMaxArrivalResidual) contradicted_ = false;
  is_expected_ = true;
  arrivals_.begin(pulse, at);
  on_time_frames_ = kConfirmationsOfArrival;
  delay_ = 0;
  steadily_late_ = 0;
}

PulseMatcher::Evidence PulseMatcher::evaluate(const FrameStamp& frame) const {
  Evidence e;
  e.by_clock = fit_.pulse_at(to_ns(frame.exposed));
  e.clock_pulse = std::llround(e.by_clock);
  e.off_pulse = std::abs(e.by_clock - static_cast<double>(e.clock_pulse)) > kMaxResidual;
  e.by_counter = last_pulse_ + static_cast<int64_t>(frame.counter - last_counter_);
  e.by_arrival = arrivals_.pulse_at(to_ns(frame.received));
  return e;
}

bool PulseMatcher::is_consistent(const Evidence& e) const {
  if (e.off_pulse || unreliable_) return false;
  if (!reopened_) return e.clock_pulse == e.by_counter;
  // The counter restarted and is not used. A restarted clock matches the arrival only by chance.
  return e.clock_pulse > last_pulse_ && fit_.stddev(e.clock_pulse) <= kMaxStddev &&
         std::abs(e.by_clock - e.by_arrival) < kMaxArrivalResidual;
}

PulseMatch PulseMatcher::accept(int64_t pulse, const FrameStamp& frame) {
  reopened_ = resumed_ = false;
  stragglers_ = 0;
  run_.reset();
  const bool imprecise = fit_.stddev(pulse) > kMaxStddev;
  fit_.update(pulse, to_ns(frame.exposed));
  learn_arrival(pulse, frame.received);
  last_pulse_ = pulse;
  last_counter_ = frame.counter;
  return {pulse, imprecise || start_uncertain_};
}

PulseMatch PulseMatcher::handle_inconsistent(const Evidence& e, const FrameStamp& frame) {
  if (reopened_) unreliable_ = true;  // the clock restarted, or may have
  extend_run(e, frame);
  if (!run_ || !run_is_conclusive(e) || clock_contradicts(e)) return {most_likely_pulse(e), true};
  const int64_t pulse = run_->pulse;
  resynchronise(pulse, frame);
  return {pulse, start_uncertain_};
}

void PulseMatcher::extend_run(const Evidence& e, const FrameStamp& frame) {
  const auto on_time = [&](int64_t pulse) {
    return std::abs(e.by_arrival - static_cast<double>(pulse)) < kMaxArrivalResidual;
  };
  if (run_) {
    const auto counted = static_cast<int64_t>(frame.counter - run_->last.counter);
    const double passed = fit_.periods(to_ns(run_->last.exposed), to_ns(frame.exposed));
    if (counted > 0 && std::abs(passed - static_cast<double>(counted)) < kMaxStepError &&
        on_time(run_->pulse + counted)) {
      run_ = Run{frame, run_->pulse + counted, run_->confirmations + 1};
      return;
    }
  }
  const int64_t pulse = std::llround(e.by_arrival);
  run_.reset();
  if (on_time(pulse) && pulse > last_pulse_) run_ = Run{frame, pulse, 0};
}

bool PulseMatcher::run_is_conclusive(const Evidence& e) const {
  if (arrivals_.stddev(run_->pulse) > kMaxArrivalStddev) return false;
  // An imprecise clock agrees by chance.
  const bool by_clock =
      !e.off_pulse && run_->pulse == e.clock_pulse && fit_.stddev(e.clock_pulse) <= kMaxStddev;
  // Arrivals of before a restart are known by the wall clock only, which may have been set.
  if (resumed_ && !is_expected_ && !by_clock) return false;
  // The counter errs by whole pulses, for example after a repeated frame. If the clock gives a
  // pulse that is a little earlier and has no frame, the frames may be late instead of the clock
  // wrong.
  const int64_t delay = run_->pulse - e.clock_pulse;
  const bool may_be_late =
      !e.off_pulse && e.clock_pulse > last_pulse_ && delay > 0 && delay <= kMaxEqualDelay;
  const bool by_counter = !reopened_ && run_->pulse == e.by_counter && !may_be_late;
  if (run_->confirmations <
      (by_clock || by_counter ? kConfirmationsOfTwo : kConfirmationsOfArrival))
    return false;
  // If all earlier frames were late, the arrival suggests an earlier pulse than the true one. So
  // the arrival counts only after enough frames on time, or if clock or counter agree with it and
  // the other one gives an earlier pulse.
  return on_time_frames_ >= kConfirmationsOfArrival || (by_clock && run_->pulse > e.by_counter) ||
         (by_counter && run_->pulse > e.clock_pulse);
}

/// After a restart of this process: the camera's clock most likely kept running if it gives a later
/// pulse than the last one. If it then clearly contradicts the arrival, the host's clock may have
/// been set instead.
///
/// The fit is not updated while frames are suspect, and its standard deviation grows. So the limit
/// is that of the first frame, and a contradiction is final: otherwise minutes of it would prove
/// the number by the arrivals.
bool PulseMatcher::clock_contradicts(const Evidence& e) {
  if (!resumed_) return false;
  if (e.by_clock > static_cast<double>(last_pulse_)) {
    const double limit =
        kMaxArrivalResidual + kMaxDeviations * resumed_stddev_.value_or(fit_.stddev(e.clock_pulse));
    contradicted_ =
        contradicted_ || std::abs(e.by_clock - static_cast<double>(run_->pulse)) > limit;
  }
  return contradicted_;
}

/// Best estimate for a suspect frame: the pulse by clock or by counter, whichever is nearer to the
/// arrival. The counter of a reopened camera is not used. Its clock is used if the frame is late by
/// less than kMaxDelayAfterReopen: a restarted clock would hardly give a pulse so near.
int64_t PulseMatcher::most_likely_pulse(const Evidence& e) const {
  if (run_ && run_->confirmations > 0) return run_->pulse;
  const auto late = [&](int64_t pulse) { return e.by_arrival - static_cast<double>(pulse); };
  if (reopened_) {
    const double by_clock = late(e.clock_pulse);
    const bool clock_continues =
        !e.off_pulse && by_clock > -kMaxArrivalResidual && by_clock < kMaxDelayAfterReopen;
    const int64_t pulse = clock_continues ? e.clock_pulse : std::llround(e.by_arrival);
    return std::max(pulse, last_pulse_ + 1);
  }
  const bool clock = !e.off_pulse && std::abs(late(e.clock_pulse)) < std::abs(late(e.by_counter));
  const int64_t pulse = clock ? e.clock_pulse : e.by_counter;
  const bool possible = std::abs(late(pulse)) <= kMaxDelay;
  return std::max<int64_t>(possible ? pulse : std::llround(e.by_arrival), 0);
}

void PulseMatcher::resynchronise(int64_t pulse, const FrameStamp& frame) {
  fit_.begin(pulse, to_ns(frame.exposed));
  last_pulse_ = pulse;
  last_counter_ = frame.counter;
  reopened_ = unreliable_ = resumed_ = contradicted_ = false;
  stragglers_ = 0;
  run_.reset();
}

/// Updates the fit of arrivals with frames on time. Restarts it at an earlier arrival, because no
/// frame arrives before its time. Ignores later arrivals as delays of host or network, unless
/// kConfirmationsOfArrival of them in a row have the same delay.
void PulseMatcher::learn_arrival(int64_t pulse, MonotonicInstant received) {
  const int64_t at = to_ns(received);
  const double late = arrivals_.pulse_at(at) - static_cast<double>(pulse);
  const bool as_before = std::abs(late - delay_) < kMaxArrivalResidual;
  delay_ = late;
  steadily_late_ = late > kMaxArrivalResidual && as_before ? steadily_late_ + 1 : 0;
  if (std::abs(late) <= kMaxArrivalResidual) {
    arrivals_.update(pulse, at);
    on_time_frames_ = std::min(on_time_frames_ + 1, kConfirmationsOfArrival);
  } else if (late < 0 || steadily_late_ >= kConfirmationsOfArrival) {
    arrivals_.begin(pulse, at);
    on_time_frames_ = std::exchange(steadily_late_, 0);
  }
}

namespace {

// Both as a part of the nominal period.
constexpr double kPeriodUncertainty = 200e-6;  ///< initial error: two crystals, one warm, one cold
constexpr double kPeriodDrift = 0.02e-6;       ///< change from one pulse to the next

double square(double x) { return x * x; }

/// a - b. Wraps around, because a device may send any value.
double difference(int64_t a, int64_t b) {
  return static_cast<double>(
      static_cast<int64_t>(static_cast<uint64_t>(a) - static_cast<uint64_t>(b)));
}

}  // namespace

PulseFit::PulseFit(Duration period, double jitter)
    : nominal_(static_cast<double>(period.count())),
      stamp_variance_(square(jitter * nominal_)),
      drift_variance_(square(kPeriodDrift * nominal_)),
      period_(nominal_),
      period_variance_(square(kPeriodUncertainty * nominal_)) {}

void PulseFit::begin(int64_t pulse, int64_t instant_ns) {
  started_ = true;
  pulse_ = pulse;
  instant_ = instant_ns;
  fraction_ = 0;
  instant_variance_ = stamp_variance_;
  covariance_ = 0;
}

double PulseFit::pulse_at(int64_t instant_ns) const {
  const double since = difference(instant_ns, instant_) - fraction_;
  return static_cast<double>(pulse_) + since / period_;
}

double PulseFit::periods(int64_t from_ns, int64_t to_ns) const {
  return difference(to_ns, from_ns) / period_;
}

double PulseFit::stddev(int64_t pulse) const {
  const double n = std::abs(static_cast<double>(pulse - pulse_));
  const double variance =
      instant_variance_ + 2 * n * covariance_ + n * n * period_variance_ + stamp_variance_;
  return std::sqrt(variance) / nominal_;
}

void PulseFit::update(int64_t pulse, int64_t instant_ns) {
  if (pulse <= pulse_) return;
  const auto n = static_cast<double>(pulse - pulse_);
  // Prediction, n periods later.
  const double predicted = fraction_ + n * period_;
  instant_variance_ += 2 * n * covariance_ + n * n * period_variance_;
  covariance_ += n * period_variance_;
  period_variance_ += n * drift_variance_;
  // Correction by the measured time.
  const double innovation = difference(instant_ns, instant_) - predicted;
  const double total = instant_variance_ + stamp_variance_;
  const double instant_gain = instant_variance_ / total;
  const double period_gain = covariance_ / total;
  const double corrected = predicted + instant_gain * innovation;
  period_ += period_gain * innovation;
  period_variance_ -= period_gain * covariance_;
  covariance_ *= 1 - instant_gain;
  instant_variance_ *= 1 - instant_gain;
  // instant_ is an integer and fraction_ below 1, so precision does not depend on the train's
  // length.
  const double whole = std::floor(corrected);
  instant_ += static_cast<int64_t>(whole);
  fraction_ = corrected - whole;
  pulse_ = pulse;
}

}  // namespace v3d::capture
