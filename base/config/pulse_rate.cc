#include "base/config/pulse_rate.h"

#include <array>
#include <cstdio>

namespace v3d {

std::string pulse_rate_error(double hz) {
  std::array<char, 128> text{};
  std::snprintf(text.data(), text.size(),
                "a pulse rate of %g Hz is not possible; expected %g to %g Hz", hz, kMinPulseRateHz,
                kMaxPulseRateHz);
  return text.data();
}

}  // namespace v3d
