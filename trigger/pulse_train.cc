#include "trigger/pulse_train.h"

#include "base/config/pulse_rate.h"
#include "base/core/error.h"

namespace v3d {

void refuse_impossible(const PulseTrain& train, const std::string& who) {
  const auto refuse = [&](const std::string& what, const std::string& right) {
    throw InputError(who + ": " + what + "; right would be " + right);
  };
  const double rate = train.rate_hz;
  if (!is_pulse_rate(rate)) throw InputError(who + ": " + impossible_pulse_rate(rate));
  if (train.width <= Duration::zero() || train.width >= period_of(rate)) {
    refuse("pulse width " + std::to_string(train.width.count()) + " ns at " + std::to_string(rate) +
               " Hz",
           "more than 0 and less than the period");
  }
  if (train.count && *train.count < 1) {
    refuse("count " + std::to_string(*train.count), "at least 1, or none for a train without end");
  }
}

}  // namespace v3d
