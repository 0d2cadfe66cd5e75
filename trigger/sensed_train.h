// Assigns pulse numbers to sensed pulses, by comparison with the commanded train.
#pragma once

#include <cmath>
#include <cstdint>
#include <optional>
#include <vector>

#include "trigger/pulse_generator.h"

namespace v3d::trigger {

/// Numbers sensed pulses by the time since the previous pulse, in periods.
///
/// A line carries no pulse numbers, and pulses may be missing. The first sensed pulse is pulse 0,
/// as the first frame is frame 0: give it pulses from the start of the train on only. A pulse less
/// than half a period after the previous one is extra and changes no number. A pulse of less than
/// half the commanded width is a runt. A runt within an eighth of a period of its expected time
/// gets a number, because cameras may have been triggered by it; another runt is extra. A pulse
/// that is_numbered keeps its number. Not thread-safe.
class SensedTrain {
 public:
  explicit SensedTrain(const PulseTrain& train)
      : period_(to_seconds(period_of(train.rate_hz))), min_width_(train.width / 2) {}

  /// The number of the pulse, larger than all previous numbers; empty for an extra pulse.
  std::optional<int64_t> number(const SensedPulse& pulse) {
    if (pulse.is_numbered) return adopt(pulse);
    const bool runt = pulse.width && *pulse.width < min_width_;
    const double periods = last_ ? to_seconds(pulse.at - *last_) / period_ : 0;
    const auto whole = static_cast<int64_t>(std::llround(periods));
    const bool out_of_place = std::abs(periods - static_cast<double>(whole)) > kRuntTolerance;
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

  /// Counts a pulse that was sensed before the start of the train.
  void count_extra() { ++extra_; }

  /// The number of pulses with a number.
  int64_t sensed() const { return sensed_; }
  /// The number of extra pulses.
  int64_t extra() const { return extra_; }
  /// Numbers of the runts in the train.
  const std::vector<int64_t>& runts() const { return runts_; }

 private:
  std::optional<int64_t> adopt(const SensedPulse& pulse) {
    if (last_ && pulse.number <= number_) {
      ++extra_;
      return std::nullopt;
    }
    number_ = pulse.number;
    last_ = pulse.at;
    ++sensed_;
    return number_;
  }

  static constexpr double kRuntTolerance = 0.125;  ///< of a period

  const double period_;
  const Duration min_width_;
  std::optional<MonotonicInstant> last_;
  int64_t number_ = 0;
  int64_t sensed_ = 0;
  int64_t extra_ = 0;
  std::vector<int64_t> runts_;
};

}  // namespace v3d::trigger
