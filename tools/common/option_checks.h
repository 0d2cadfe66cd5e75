// Validators of command line options.
#pragma once

#include <CLI/CLI.hpp>
#include <cmath>
#include <string>

#include "base/config/studio_values.h"

namespace v3d {

// Validator of command line options: numbers within limits.

/// Accepts numbers from `low` to `high`; for CLI::Option::check(). CLI::Range also accepts NaN, and
/// prints limits with up to 300 digits.
inline CLI::Validator number_in(double low, double high) {
  const auto text_of = [](double number) { return CLI::detail::to_string(number); };
  const std::string limits = text_of(low) + " to " + text_of(high);
  const auto check = [=](const std::string& text) {
    double number = NAN;
    const bool good = CLI::detail::lexical_cast(text, number) && number >= low && number <= high;
    return good ? std::string() : "expected a number from " + limits + ", found '" + text + "'";
  };
  return {check, "FLOAT in [" + text_of(low) + " - " + text_of(high) + "]"};
}

// Validator of command line options: pulse rates.

/// For CLI::Option::check(): returns an error message, or an empty string for a valid rate in Hz.
inline std::string check_pulse_rate(const std::string& text) {
  double hz = 0;
  if (!CLI::detail::lexical_cast(text, hz)) return "expected a number of Hz, found '" + text + "'";
  return is_pulse_rate(hz) ? std::string() : pulse_rate_error(hz);
}

}  // namespace v3d
