// What the sense line saw, held against the train that was commanded.
#pragma once

#include <cmath>
#include <cstdint>
#include <optional>
#include <vector>

#include "trigger/pulse_generator.h"

namespace v3d {

/// A pulse on a line carries no number, and one that the generator left out is not there: so the
/// number follows from the time since the pulse before, in periods. The first is pulse 0, as the
/// first frame is. What comes less than half a period after a pulse is no pulse of the train but
/// extra, and changes no number. A pulse of less than half the commanded width is a runt: in its
/// place in the train it counts, because cameras may have seen it; elsewhere it is extra. One
/// thread.
class SensedTrain {
 public:
  explicit SensedTrain(const PulseTrain& train)
      : period_(to_seconds(period_of(train.rate_hz))), shortest_(train.width / 2) {}

  /// Higher than every number before; empty for an extra pulse.
  std::optional<int64_t> number(const SensedPulse& pulse) {
    const bool runt = pulse.width && *pulse.width < shortest_;
    const double periods = last_ ? to_seconds(pulse.at - *last_) / period_ : 0;
    const auto whole = static_cast<int64_t>(std::llround(periods));
    const bool out_of_place = std::abs(periods - static_cast<double>(whole)) > kRuntPlace;
    if (last_ && (whole < 1 || (runt && out_of_place))) {
      ++extra_;
      return std::nullopt;
    }
    number_ += whole;
    last_ = pulse.at;
    ++sensed_;
    if (runt) runts_.push_back(number_);
    return number_;
  }

  /// Pulses that have a number.
  int64_t sensed() const { return sensed_; }
  int64_t extra() const { return extra_; }
  const std::vector<int64_t>& runts() const { return runts_; }

 private:
  static constexpr double kRuntPlace = 0.125;  ///< of a period

  const double period_;
  const Duration shortest_;
  std::optional<MonotonicInstant> last_;
  int64_t number_ = 0;
  int64_t sensed_ = 0;
  int64_t extra_ = 0;
  std::vector<int64_t> runts_;
};

}  // namespace v3d
