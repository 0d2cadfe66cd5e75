// Checks of command line options that several tools share.
#pragma once

#include <optional>
#include <string>

#include "base/config/studio_values.h"
#include "cli/command.h"

namespace v3d {

/// Accepts valid pulse rates in Hz.
inline cli::Check pulse_rate() {
  const auto error = [](const std::string& text) {
    const std::optional<double> hz = cli::number_of(text);
    if (!hz) return "expected a number of Hz, found '" + text + "'";
    return is_pulse_rate(*hz) ? std::string() : pulse_rate_error(*hz);
  };
  return {error, ""};
}

}  // namespace v3d
