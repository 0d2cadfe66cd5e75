// The pulse rates at which a studio can run: in the studio file, a pulse train, an operator's
// command.
#pragma once

#include <string>

namespace v3d {

inline constexpr double kMinPulseRateHz = 0.01;
inline constexpr double kMaxPulseRateHz = 1000;

/// False for NaN.
constexpr bool is_pulse_rate(double hz) { return hz >= kMinPulseRateHz && hz <= kMaxPulseRateHz; }

/// What a rate outside the range is refused with: "a pulse rate of 5000 Hz is not possible;
/// expected 0.01 to 1000 Hz".
std::string impossible_pulse_rate(double hz);

}  // namespace v3d
