#include "v3dctl/takes/named_takes.h"

#include <algorithm>
#include <cstdio>

#include "base/units.h"
#include "common/local_time.h"

namespace v3d::ctl {

std::string format_length_of_time(double seconds) {
  const auto whole = static_cast<int64_t>(seconds + 0.5);
  char text[32];
  if (whole < 3600) {
    std::snprintf(text, sizeof text, "%d:%02d", static_cast<int>(whole / 60),
                  static_cast<int>(whole % 60));
  } else {
    std::snprintf(text, sizeof text, "%d:%02d:%02d", static_cast<int>(whole / 3600),
                  static_cast<int>(whole / 60 % 60), static_cast<int>(whole % 60));
  }
  return text;
}

std::vector<std::string> listing_lines(const std::vector<TakeListing>& takes) {
  size_t width = 4;
  for (const TakeListing& take : takes) width = std::max(width, take.info.name.size());
  std::vector<std::string> lines;
  for (const TakeListing& take : takes) {
    char text[512];
    std::snprintf(text, sizeof text,
                  "%-*s  %s  %-10s %-10s  %7s  %8s  %3zu cameras x %7s pulses, %g Hz, %s meshes",
                  static_cast<int>(width), take.info.name.c_str(),
                  local_time(take.info.started, "%Y-%m-%d %H:%M").c_str(), take.verdict().data(),
                  take.verified ? "verified" : "unverified",
                  format_length_of_time(take.seconds()).c_str(),
                  format_bytes(static_cast<double>(take.bytes)).c_str(), take.info.cameras.size(),
                  format_count(take.info.pulses).c_str(), take.info.rate_hz,
                  format_count(take.meshes).c_str());
    const std::string slate = take.slate.text();
    lines.push_back(text + (slate.empty() ? "" : "  " + slate));
  }
  return lines;
}

}  // namespace v3d::ctl
