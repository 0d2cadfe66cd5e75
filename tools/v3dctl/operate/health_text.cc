#include "v3dctl/operate/health_text.h"

#include <algorithm>
#include <cmath>
#include <cstdio>

#include "base/units.h"
#include "v3dctl/operate/reply_text.h"

namespace v3d::ctl {
namespace {

std::string printed(const char* format, double value) {
  char text[64];
  std::snprintf(text, sizeof text, format, value);
  return text;
}

/// Values of one camera: "cam03.frames" to "frames".
using Values = std::map<std::string, double>;

std::map<std::string, Values> cameras_of(const HealthMessage& health) {
  std::map<std::string, Values> cameras;
  for (const auto& [name, value] : health.values) {
    const size_t dot = name.find('.');
    if (dot != std::string::npos) cameras[name.substr(0, dot)][name.substr(dot + 1)] = value;
  }
  return cameras;
}

std::string left(std::string text, size_t width) {
  text.resize(std::max(text.size(), width), ' ');
  return text;
}

std::string right(const std::string& text, size_t width) {
  return std::string(width - std::min(width, text.size()), ' ') + text;
}

/// A row for every value, a column for every camera.
void add_camera_table(const std::map<std::string, Values>& cameras,
                      std::vector<std::string>& lines) {
  std::map<std::string, std::string> rows;
  for (const auto& [camera, values] : cameras) {
    for (const auto& [name, value] : values) rows.try_emplace(name, "      " + left(name, 26));
  }
  std::string head(32, ' ');
  for (const auto& [camera, values] : cameras) {
    size_t width = camera.size();
    for (const auto& [name, value] : values)
      width = std::max(width, value_text(name, value).size());
    head += "  " + right(camera, width);
    for (auto& [name, row] : rows) {
      const auto found = values.find(name);
      row += "  " + right(found == values.end() ? "-" : value_text(name, found->second), width);
    }
  }
  lines.push_back(head);
  for (const auto& [name, row] : rows) lines.push_back(row);
}

}  // namespace

std::string duration_text(double seconds) {
  constexpr double kMinute = 60, kHour = 3600, kDay = 86400;
  if (seconds < 2 * kMinute) return printed("%.0f s", seconds);
  if (seconds < 2 * kHour) return printed("%.0f min", seconds / kMinute);
  if (seconds < 2 * kDay) return printed("%.1f h", seconds / kHour);
  return printed("%.0f d", seconds / kDay);
}

std::string value_text(const std::string& name, double value) {
  if (name.ends_with("_bytes")) return format_bytes(value);
  if (name.ends_with("_seconds_left")) return duration_text(value);
  if (name.ends_with("_flag")) return value != 0 ? "yes" : "no";
  if (name.ends_with("_percent")) return printed("%.0f %%", value);
  if (name.ends_with("_celsius")) return printed("%.0f C", value);
  if (name.ends_with("_per_second") || name.ends_with("_fps")) return printed("%.1f/s", value);
  if (name.ends_with("_ms")) return printed("%.1f ms", value);
  if (name.ends_with("offset_us")) return printed("%+.0f us", value);
  if (name.ends_with("_us")) return printed("%.0f us", value);
  const bool counts = std::abs(value) < 1e15 && value == std::floor(value);
  return counts ? format_count(static_cast<int64_t>(value)) : printed("%.6g", value);
}

std::vector<std::string> health_lines(const std::vector<std::string>& nodes,
                                      const std::map<std::string, HealthMessage>& health) {
  std::vector<std::string> lines;
  for (const std::string& node : nodes) {
    lines.push_back(status_lines({node}, health).front());
    const auto found = health.find(node);
    if (found == health.end()) continue;
    lines.push_back("    " + left("version", 28) + found->second.version);
    if (!found->second.values.contains("clock_synchronised_flag")) {
      lines.push_back("    " + left("clock", 28) +
                      "unknown: neither chronyd nor systemd-timesyncd runs there");
    }
    for (const auto& [name, value] : found->second.values) {
      if (name.find('.') != std::string::npos) continue;
      lines.push_back("    " + left(name, 28) + value_text(name, value));
    }
    const auto cameras = cameras_of(found->second);
    if (!cameras.empty()) add_camera_table(cameras, lines);
  }
  return lines;
}

}  // namespace v3d::ctl
