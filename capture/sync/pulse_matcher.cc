#include "capture/sync/pulse_matcher.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace v3d {
namespace {

constexpr double kStampJitter = 0.05;            ///< standard deviation, periods
constexpr double kLargestResidual = 0.21;        ///< periods
constexpr double kLargestStepError = 0.25;       ///< periods, between two frames
constexpr double kLargestDoubt = 0.15;           ///< standard deviation of the fit, periods
constexpr double kArrivalJitter = 0.1;           ///< standard deviation, periods
constexpr double kLargestArrivalResidual = 0.4;  ///< periods, of a frame that is not late
constexpr double kLargestArrivalDoubt = 0.2;     ///< standard deviation of the fit, periods
constexpr double kLatestFrame = 1000;            ///< periods; nothing waits so long anywhere
constexpr double kLatestAfterOpening = 10;       ///< periods; a host that opens a camera is busy
constexpr int kSecond = 1;                       ///< confirmations of two witnesses out of three
constexpr int kMany = 8;                         ///< confirmations of the arrival alone
constexpr int kFewStragglers = 3;                ///< in a row
constexpr double kMuchLater = 2;                 ///< periods
constexpr double kManyDeviations = 4;            ///< standard deviations

}  // namespace

PulseMatcher::PulseMatcher(Duration period)
    : fit_(period, kStampJitter), arrivals_(period, kArrivalJitter) {}

PulseMatch PulseMatcher::label(const FrameStamp& frame) {
  if (!begun()) return first(frame);
  const Evidence e = weigh(frame);
  if (!agreed(e)) return doubt(e, frame);
  // A duplicate, or a straggler; several in a row are a camera that began anew and counts again
  // what it has counted before, as is one behind which frames are much later than before.
  if (e.clock_pulse <= last_pulse_) {
    astray_ = ++stragglers_ >= kFewStragglers;
    return doubt(e, frame);
  }
  const double late = e.by_arrival - static_cast<double>(e.clock_pulse);
  if (stragglers_ > 0 && late - lateness_ > kMuchLater) return doubt(e, frame);
  return accept(e.clock_pulse, frame);
}

PulseMatch PulseMatcher::first(const FrameStamp& frame) {
  settle(last_pulse_, frame);
  arrivals_.begin(last_pulse_, to_ns(frame.received));
  return {last_pulse_, start_unknown_};
}

void PulseMatcher::go_on_from(std::span<const KnownFrame> frames) {
  begin(frames.front().pulse, true);
  first(frames.front().stamp);
  for (const KnownFrame& frame : frames.subspan(1)) accept(frame.pulse, frame.stamp);
  reopened_ = was_away_ = true;
}

void PulseMatcher::expect(int64_t pulse, MonotonicInstant arrival) {
  arrivals_.begin(pulse, to_ns(arrival));
  punctual_ = kMany;
  lateness_ = 0;
  steadily_late_ = 0;
}

PulseMatcher::Evidence PulseMatcher::weigh(const FrameStamp& frame) const {
  Evidence e;
  e.by_clock = fit_.pulse_at(to_ns(frame.exposed));
  e.clock_pulse = std::llround(e.by_clock);
  e.between = std::abs(e.by_clock - static_cast<double>(e.clock_pulse)) > kLargestResidual;
  e.by_counter = last_pulse_ + static_cast<int64_t>(frame.counter - last_counter_);
  e.by_arrival = arrivals_.pulse_at(to_ns(frame.received));
  return e;
}

bool PulseMatcher::agreed(const Evidence& e) const {
  if (e.between || astray_) return false;
  if (!reopened_) return e.clock_pulse == e.by_counter;
  // The counter says nothing. A clock that began anew would not fit the arrival but by chance.
  return e.clock_pulse > last_pulse_ && fit_.doubt(e.clock_pulse) <= kLargestDoubt &&
         std::abs(e.by_clock - e.by_arrival) < kLargestArrivalResidual;
}

PulseMatch PulseMatcher::accept(int64_t pulse, const FrameStamp& frame) {
  reopened_ = was_away_ = false;
  stragglers_ = 0;
  row_.reset();
  const bool in_the_dark = fit_.doubt(pulse) > kLargestDoubt;
  fit_.learn(pulse, to_ns(frame.exposed));
  learn_arrival(pulse, frame.received);
  last_pulse_ = pulse;
  last_counter_ = frame.counter;
  return {pulse, in_the_dark || start_unknown_};
}

PulseMatch PulseMatcher::doubt(const Evidence& e, const FrameStamp& frame) {
  if (reopened_) astray_ = true;  // the clock does not go on, or not for certain
  lengthen_row(e, frame);
  if (!row_ || !row_convinces(e)) return {likeliest(e), true};
  const int64_t pulse = row_->pulse;
  settle(pulse, frame);
  return {pulse, start_unknown_};
}

void PulseMatcher::lengthen_row(const Evidence& e, const FrameStamp& frame) {
  const auto on_time = [&](int64_t pulse) {
    return std::abs(e.by_arrival - static_cast<double>(pulse)) < kLargestArrivalResidual;
  };
  if (row_) {
    const auto counted = static_cast<int64_t>(frame.counter - row_->last.counter);
    const double passed = fit_.periods(to_ns(row_->last.exposed), to_ns(frame.exposed));
    if (counted > 0 && std::abs(passed - static_cast<double>(counted)) < kLargestStepError &&
        on_time(row_->pulse + counted)) {
      row_ = Row{frame, row_->pulse + counted, row_->confirmations + 1};
      return;
    }
  }
  const int64_t pulse = std::llround(e.by_arrival);
  row_.reset();
  if (on_time(pulse) && pulse > last_pulse_) row_ = Row{frame, pulse, 0};
}

bool PulseMatcher::row_convinces(const Evidence& e) const {
  if (arrivals_.doubt(row_->pulse) > kLargestArrivalDoubt || clock_objects(e)) return false;
  const bool by_clock = !e.between && row_->pulse == e.clock_pulse;
  const bool by_counter = !reopened_ && row_->pulse == e.by_counter;
  if (row_->confirmations < (by_clock || by_counter ? kSecond : kMany)) return false;
  // Frames before may all have been late; then this one seems to be of an earlier pulse than it is.
  return punctual_ >= kMany || (by_clock && row_->pulse > e.by_counter) ||
         (by_counter && row_->pulse > e.clock_pulse);
}

/// After an absence: a clock that says a later pulse than before has most likely gone on; when it
/// says clearly another pulse than the arrival, the host's clock may be what was set.
bool PulseMatcher::clock_objects(const Evidence& e) const {
  if (!was_away_ || e.by_clock <= static_cast<double>(last_pulse_)) return false;
  const double apart = std::abs(e.by_clock - static_cast<double>(row_->pulse));
  return apart > kLargestArrivalResidual + kManyDeviations * fit_.doubt(e.clock_pulse);
}

/// The clock's or the counter's pulse, whichever the arrival is nearer to. The counter of a camera
/// that was opened again says nothing, and its clock goes on if its frame is late but little: one
/// that began anew would hardly say a pulse so near.
int64_t PulseMatcher::likeliest(const Evidence& e) const {
  if (row_ && row_->confirmations > 0) return row_->pulse;
  const auto late = [&](int64_t pulse) { return e.by_arrival - static_cast<double>(pulse); };
  if (reopened_) {
    const double by_clock = late(e.clock_pulse);
    const bool goes_on =
        !e.between && by_clock > -kLargestArrivalResidual && by_clock < kLatestAfterOpening;
    const int64_t pulse = goes_on ? e.clock_pulse : std::llround(e.by_arrival);
    return std::max(pulse, last_pulse_ + 1);
  }
  const bool clock = !e.between && std::abs(late(e.clock_pulse)) < std::abs(late(e.by_counter));
  const int64_t pulse = clock ? e.clock_pulse : e.by_counter;
  const bool possible = std::abs(late(pulse)) <= kLatestFrame;
  return std::max<int64_t>(possible ? pulse : std::llround(e.by_arrival), 0);
}

void PulseMatcher::settle(int64_t pulse, const FrameStamp& frame) {
  fit_.begin(pulse, to_ns(frame.exposed));
  last_pulse_ = pulse;
  last_counter_ = frame.counter;
  reopened_ = astray_ = was_away_ = false;
  stragglers_ = 0;
  row_.reset();
}

/// Follows the earliest: nothing arrives before its time. Later arrivals are the host's hesitation,
/// unless they stay so.
void PulseMatcher::learn_arrival(int64_t pulse, MonotonicInstant received) {
  const int64_t at = to_ns(received);
  const double late = arrivals_.pulse_at(at) - static_cast<double>(pulse);
  const bool as_before = std::abs(late - lateness_) < kLargestArrivalResidual;
  lateness_ = late;
  steadily_late_ = late > kLargestArrivalResidual && as_before ? steadily_late_ + 1 : 0;
  if (std::abs(late) <= kLargestArrivalResidual) {
    arrivals_.learn(pulse, at);
    punctual_ = std::min(punctual_ + 1, kMany);
  } else if (late < 0 || steadily_late_ >= kMany) {
    arrivals_.begin(pulse, at);
    punctual_ = std::exchange(steadily_late_, 0);
  }
}

}  // namespace v3d
