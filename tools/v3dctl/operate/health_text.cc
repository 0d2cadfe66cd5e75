#include "v3dctl/operate/health_text.h"

#include <fmt/core.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "base/core/text.h"
#include "daemon/control/take_name.h"

namespace v3d::ctl {
namespace {

/// Values of one camera by name; "cam03.frames" of the node is "frames".
using CameraValues = std::map<std::string, double>;

std::map<std::string, CameraValues> values_by_camera(const wire::HealthMessage& health) {
  std::map<std::string, CameraValues> cameras;
  for (const auto& [name, value] : health.values) {
    const wire::HealthName parts = wire::split_health_name(name);
    if (!parts.camera.empty()) cameras[parts.camera][parts.name] = value;
  }
  return cameras;
}

std::string pad_right(std::string text, size_t width) {
  text.resize(std::max(text.size(), width), ' ');
  return text;
}

std::string pad_left(const std::string& text, size_t width) {
  return std::string(width - std::min(width, text.size()), ' ') + text;
}

/// One row for each value, one column for each camera.
void add_camera_table(const std::map<std::string, CameraValues>& cameras,
                      std::vector<std::string>& lines) {
  std::map<std::string, std::string> rows;
  for (const auto& [camera, values] : cameras) {
    for (const auto& [name, value] : values) rows.try_emplace(name, "      " + pad_right(name, 26));
  }
  std::string head(32, ' ');
  for (const auto& [camera, values] : cameras) {
    size_t width = camera.size();
    for (const auto& [name, value] : values)
      width = std::max(width, value_text(name, value).size());
    head += "  " + pad_left(camera, width);
    for (auto& [name, row] : rows) {
      const auto found = values.find(name);
      row += "  " + pad_left(found == values.end() ? "-" : value_text(name, found->second), width);
    }
  }
  lines.push_back(head);
  for (const auto& [name, row] : rows) lines.push_back(row);
}

double max_over_nodes(const std::map<std::string, wire::HealthMessage>& health,
                      const std::string& name) {
  double max = 0;
  for (const auto& [node, message] : health) {
    const auto found = message.values.find(name);
    if (found != message.values.end()) max = std::max(max, found->second);
  }
  return max;
}

}  // namespace

std::string duration_text(double seconds) {
  constexpr double kMinute = 60, kHour = 3600, kDay = 86400;
  if (seconds < 2 * kMinute) return fmt::format("{:.0f} s", seconds);
  if (seconds < 2 * kHour) return fmt::format("{:.0f} min", seconds / kMinute);
  if (seconds < 2 * kDay) return fmt::format("{:.1f} h", seconds / kHour);
  return fmt::format("{:.0f} d", seconds / kDay);
}

std::string value_text(const std::string& name, double value) {
  if (name.ends_with("_bytes")) return format_bytes(value);
  if (name.ends_with("_seconds_left")) return duration_text(value);
  if (name.ends_with("_flag")) return value != 0 ? "yes" : "no";
  if (name.ends_with("_percent")) return fmt::format("{:.0f} %", value);
  if (name.ends_with("_celsius")) return fmt::format("{:.0f} C", value);
  if (name.ends_with("_per_second") || name.ends_with("_fps"))
    return fmt::format("{:.1f}/s", value);
  if (name.ends_with("_ms")) return fmt::format("{:.1f} ms", value);
  if (name.ends_with("offset_us")) return fmt::format("{:+.0f} us", value);
  if (name.ends_with("_us")) return fmt::format("{:.0f} us", value);
  const bool is_count = std::abs(value) < 1e15 && value == std::floor(value);
  return is_count ? format_count(static_cast<int64_t>(value)) : fmt::format("{:.6g}", value);
}

std::string silent_node_advice(const std::string& node) {
  return "Try: systemctl status --all 'v3d-*' on " + node;
}

std::string doing_text(const wire::HealthMessage& health) {
  if (control::records_nothing(health)) return health.take + ": nothing is recorded";
  const std::string state(name(health.state));
  return health.take.empty() ? state : pad_right(state, 9) + "  " + health.take;
}

std::vector<std::string> status_lines(const std::vector<std::string>& nodes,
                                      const std::map<std::string, wire::HealthMessage>& health) {
  std::vector<std::string> lines;
  for (const std::string& node : nodes) {
    const auto found = health.find(node);
    if (found == health.end()) {
      lines.push_back(pad_right(node, 12) + "  silent. " + silent_node_advice(node));
      continue;
    }
    const wire::HealthMessage& message = found->second;
    std::string line = pad_right(node, 12) + "  " + pad_right(message.program, 12) + "  " +
                       pad_right(doing_text(message), 9);
    if (!message.text.empty()) line += "  " + message.text;
    while (line.ends_with(' ')) line.pop_back();
    lines.push_back(line);
  }
  return lines;
}

bool has_clock_state(const wire::HealthMessage& health) {
  return health.values.contains("clock_synchronised_flag") ||
         health.values.contains("ptp_steps_removed");
}

std::vector<std::string> health_lines(const std::vector<std::string>& nodes,
                                      const std::map<std::string, wire::HealthMessage>& health) {
  std::vector<std::string> lines;
  for (const std::string& node : nodes) {
    lines.push_back(status_lines({node}, health).front());
    const auto found = health.find(node);
    if (found == health.end()) continue;
    lines.push_back("    " + pad_right("version", 28) + found->second.version);
    if (!has_clock_state(found->second)) {
      lines.push_back("    " + pad_right("clock", 28) + "unknown: " + kNoClockState);
    }
    for (const auto& [name, value] : found->second.values) {
      if (!wire::split_health_name(name).camera.empty()) continue;
      lines.push_back("    " + pad_right(name, 28) + value_text(name, value));
    }
    const auto cameras = values_by_camera(found->second);
    if (!cameras.empty()) add_camera_table(cameras, lines);
    for (const auto& [name, text] : found->second.texts) {
      lines.push_back("      " + pad_right(name, 26) + "  " + text);
    }
  }
  return lines;
}

Json health_json(const std::vector<std::string>& nodes,
                 const std::map<std::string, wire::HealthMessage>& health) {
  Json list = Json::array();
  for (const std::string& node : nodes) {
    const auto found = health.find(node);
    if (found == health.end()) {
      list.push_back({{"node", node}, {"state", "silent"}});
      continue;
    }
    const wire::HealthMessage& message = found->second;
    list.push_back({{"node", node},
                    {"program", message.program},
                    {"version", message.version},
                    {"state", name(message.state)},
                    {"take", message.take},
                    {"text", message.text},
                    {"texts", message.texts},
                    {"values", message.values}});
  }
  return {{"well", all_well(nodes, health)}, {"nodes", list}};
}

bool all_well(const std::vector<std::string>& nodes,
              const std::map<std::string, wire::HealthMessage>& health) {
  const bool have_no_fault = std::ranges::all_of(nodes, [&](const std::string& node) {
    const auto found = health.find(node);
    return found != health.end() && found->second.state != wire::NodeState::kFault;
  });
  return have_no_fault && absent_nodes(health).empty();
}

bool all_reported(const std::vector<std::string>& nodes,
                  const std::map<std::string, wire::HealthMessage>& health) {
  return std::all_of(nodes.begin(), nodes.end(),
                     [&](const std::string& node) { return health.contains(node); });
}

bool is_in_take(const wire::HealthMessage& health) {
  return health.state == wire::NodeState::kRecording || health.state == wire::NodeState::kDraining;
}

std::vector<std::string> absent_nodes(const std::map<std::string, wire::HealthMessage>& health) {
  const auto recording = std::ranges::find_if(
      health, [](const auto& entry) { return entry.second.state == wire::NodeState::kRecording; });
  std::vector<std::string> absent;
  if (recording == health.end()) return absent;
  for (const auto& [node, message] : health) {
    // A node that prepares a take is idle, and names it.
    const bool is_outside = message.state == wire::NodeState::kFault ||
                            (message.state == wire::NodeState::kIdle && message.take.empty());
    const auto cameras = message.values.find("cameras");
    const bool has_cameras = cameras != message.values.end() && cameras->second > 0;
    if (is_outside && has_cameras) absent.push_back(node);
  }
  return absent;
}

std::optional<double> sum_over_nodes(const std::map<std::string, wire::HealthMessage>& health,
                                     const std::string& name) {
  std::optional<double> sum;
  for (const auto& [node, message] : health) {
    const auto found = message.values.find(name);
    if (found != message.values.end()) sum = sum.value_or(0) + found->second;
  }
  return sum;
}

std::string recording_line(const std::map<std::string, wire::HealthMessage>& health) {
  const auto count = [](double value) { return value_text("", value); };
  std::string line;
  const auto add = [&](const std::string& part) { line += (line.empty() ? "" : "   ") + part; };
  if (sum_over_nodes(health, "pulses_sensed")) {
    add(count(max_over_nodes(health, "pulses_sensed")) + " pulses");
  } else if (sum_over_nodes(health, "pulses_commanded")) {
    add(count(max_over_nodes(health, "pulses_commanded")) + " pulses, not sensed");
  }
  const std::vector<std::string> absent = absent_nodes(health);
  if (const auto streaming = sum_over_nodes(health, "cameras_streaming")) {
    std::map<std::string, wire::HealthMessage> present = health;
    for (const std::string& node : absent) present.erase(node);
    add(count(sum_over_nodes(present, "cameras_streaming").value_or(0)) + "/" +
        count(sum_over_nodes(health, "cameras").value_or(*streaming)) + " cameras");
  }
  if (const auto missing = sum_over_nodes(health, "frames_missing"))
    add(count(*missing) + " missing");
  if (sum_over_nodes(health, "live_fps")) {  // several nodes report the rate of the common stream
    add(fmt::format("live {:.1f}/s, {:.0f} ms", max_over_nodes(health, "live_fps"),
                    max_over_nodes(health, "latency_p50_ms")));
    if (sum_over_nodes(health, "silhouette_iou_percent")) {
      add(value_text("_percent", max_over_nodes(health, "silhouette_iou_percent")) + " explained");
    }
  }
  if (!absent.empty())
    add(join_names(absent) + (absent.size() == 1 ? " does" : " do") + " not record");
  return line;
}

}  // namespace v3d::ctl
