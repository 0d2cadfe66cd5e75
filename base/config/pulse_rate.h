// The range of pulse rates, for studio files, pulse trains and commands of operators.
#pragma once

#include <string>

namespace v3d {

inline constexpr double kMinPulseRateHz = 0.01;
inline constexpr double kMaxPulseRateHz = 1000;

/// True within the range; false for NaN.
constexpr bool is_pulse_rate(double hz) { return hz >= kMinPulseRateHz && hz <= kMaxPulseRateHz; }

/// Error message for a rate outside the range: "a pulse rate of 5000 Hz is not possible; expected
/// 0.01 to 1000 Hz".
std::string pulse_rate_error(double hz);

}  // namespace v3d
