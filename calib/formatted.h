// printf-style formatting to std::string, for reports.
#pragma once

#include <cstdarg>
#include <cstdio>
#include <string>

namespace v3d::calib {

/// The formatted text, cut after 511 characters.
__attribute__((format(printf, 1, 2))) inline std::string formatted(const char* format, ...) {
  char text[512];
  va_list arguments;
  va_start(arguments, format);
  std::vsnprintf(text, sizeof text, format, arguments);
  va_end(arguments);
  return text;
}

}  // namespace v3d::calib
