// What this PC calls itself.
#pragma once

#include <unistd.h>

#include <string>

namespace v3d::ctl {

inline std::string host_name() {
  char text[256] = {};
  gethostname(text, sizeof text - 1);
  return text;
}

}  // namespace v3d::ctl
