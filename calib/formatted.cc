#include "calib/formatted.h"

#include <cstdarg>
#include <cstdio>

namespace v3d::calib {

std::string print(const char* format, ...) {
  char text[512];
  va_list arguments;
  va_start(arguments, format);
  std::vsnprintf(text, sizeof text, format, arguments);
  va_end(arguments);
  return text;
}

}  // namespace v3d::calib
