#include "trigger/pulse_train.h"

#include "base/config/pulse_rate.h"
#include "base/core/error.h"

namespace v3d {

void check_train(const PulseTrain& train, const std::string& source) {
  const auto reject = [&](const std::string& what, const std::string& right) {
    throw InputError(source + ": " + what + "; right would be " + right);
  };
  const double rate = train.rate_hz;
  if (!is_pulse_rate(rate)) throw InputError(source + ": " + pulse_rate_error(rate));
  if (train.width <= Duration::zero() || train.width >= period_of(rate)) {
    reject("pulse width " + std::to_string(train.width.count()) + " ns at " + std::to_string(rate) +
               " Hz",
           "more than 0 and less than the period");
  }
  if (train.count && *train.count < 1) {
    reject("count " + std::to_string(*train.count), "at least 1, or none for a train without end");
  }
}

}  // namespace v3d
