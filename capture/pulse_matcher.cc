#include "capture/pulse_matcher.h"

#include <cmath>

namespace v3d {
namespace {

constexpr double kStampJitter = 0.05;       ///< standard deviation, periods
constexpr double kLargestResidual = 0.25;   ///< periods
constexpr double kLargestDoubt = 0.15;      ///< standard deviation of the fit, periods
constexpr int64_t kMostLostAtFirst = 1000;  ///< more lost exposures before the first frame are a
                                            ///< counter that means something else

}  // namespace

PulseMatcher::PulseMatcher(Duration period) : fit_(period, kStampJitter) {}

void PulseMatcher::restart(int64_t pulse, DeviceInstant at, uint64_t counter) {
  fit_.begin(pulse, to_ns(at));
  last_pulse_ = pulse;
  last_counter_ = counter;
}

PulseMatch PulseMatcher::first(DeviceInstant at, uint64_t counter) {
  PulseMatch match;
  if (counter_of_pulse_0_) {
    const auto lost = static_cast<int64_t>(counter - *counter_of_pulse_0_);
    match.suspect = lost != 0;
    if (lost > 0 && lost <= kMostLostAtFirst) match.pulse = lost;
  }
  restart(match.pulse, at, counter);
  return match;
}

PulseMatch PulseMatcher::label(DeviceInstant at, uint64_t counter) {
  if (!begun()) return first(at, counter);
  const double where = pulse_at(at);
  const auto counted = static_cast<int64_t>(counter - last_counter_);
  PulseMatch match{std::llround(where), false};
  const bool between = std::abs(where - static_cast<double>(match.pulse)) > kLargestResidual;
  const bool in_the_dark = fit_.doubt(match.pulse) > kLargestDoubt;
  if (between && std::abs(where - static_cast<double>(last_pulse_ + counted)) < 1) {
    match.pulse = last_pulse_ + counted;
  }
  const int64_t step = match.pulse - last_pulse_;
  match.suspect = between || in_the_dark || step != counted || step <= 0;
  if (!between) fit_.learn(match.pulse, to_ns(at));
  if (step > 0) {
    last_pulse_ = match.pulse;
    last_counter_ = counter;
  }
  return match;
}

}  // namespace v3d
