// Local date and time of an instant as text.
#pragma once

#include <ctime>
#include <string>

#include "base/core/time.h"

namespace v3d {

/// Formats `instant` in the time zone of this PC. `format` is that of strftime(); the result must
/// have at most 31 characters.
inline std::string local_time(RealtimeInstant instant, const char* format) {
  const std::time_t seconds = to_ns(instant) / 1'000'000'000;
  std::tm parts{};
  localtime_r(&seconds, &parts);
  char text[32];
  return {text, std::strftime(text, sizeof text, format, &parts)};
}

}  // namespace v3d
