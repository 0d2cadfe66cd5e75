// Validator of command line options: pulse rates.
#pragma once

#include <CLI/CLI.hpp>
#include <string>

#include "base/config/pulse_rate.h"

namespace v3d {

/// For CLI::Option::check(): returns an error message, or an empty string for a valid rate in Hz.
inline std::string check_pulse_rate(const std::string& text) {
  double hz = 0;
  if (!CLI::detail::lexical_cast(text, hz)) return "expected a number of Hz, found '" + text + "'";
  return is_pulse_rate(hz) ? std::string() : pulse_rate_error(hz);
}

}  // namespace v3d
