// Instants as a person reads them.
#pragma once

#include <ctime>
#include <string>

#include "base/core/time.h"

namespace v3d {

/// By the wall clock of this PC; `format` as of strftime, at most 31 characters long when filled
/// in.
inline std::string local_time(RealtimeInstant instant, const char* format) {
  const std::time_t seconds = to_ns(instant) / 1'000'000'000;
  std::tm parts{};
  localtime_r(&seconds, &parts);
  char text[32];
  return {text, std::strftime(text, sizeof text, format, &parts)};
}

}  // namespace v3d
