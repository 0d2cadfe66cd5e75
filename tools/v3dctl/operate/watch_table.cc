#include <algorithm>
#include <cmath>
#include <optional>

#include "base/core/text.h"
#include "common/console.h"
#include "daemon/control/take_name.h"
#include "v3dctl/operate/health_text.h"
#include "v3dctl/operate/studio_monitor.h"

namespace v3d::ctl {
namespace {

// Limits of warnings and alarms.
constexpr double kWarnQueue = 8;          // frames of one camera; the queue holds 32
constexpr double kWarnDiskSeconds = 600;  // of recording
constexpr double kAlarmDiskSeconds = 60;
constexpr double kWarnClockOffsetUs = 1000;  // well below the period of the pulses
constexpr double kWarnCpuPercent = 95;
constexpr double kWarnMemoryBytes = 500e6;

using Part = WatchLine::Part;

struct Column {
  const char* head;
  size_t width;
};
constexpr Column kColumns[] = {{"", 14},       {"STATE", 10}, {"RATE", 8},  {"MISSING", 8},
                               {"SUSPECT", 8}, {"QUEUE", 6},  {"DISK", 10}, {"CLOCK", 15},
                               {"CPU", 6},     {"MEMORY", 9}, {"TEMP", 5},  {"LATENCY", 8}};
constexpr size_t kColumnsOfNodes = 4;     ///< DISK to MEMORY: a camera has none of them
constexpr size_t kFirstRightAligned = 2;  // names and states are left-aligned

class Row {
 public:
  void add(std::string text, Highlight highlight = Highlight::kNone) {
    const Column& column = kColumns[line_.parts.size()];
    const size_t fill = column.width - std::min(column.width, text.size());
    if (line_.parts.size() < kFirstRightAligned) {
      text += std::string(fill, ' ');
    } else {
      text = std::string(fill, ' ') + text;
    }
    line_.parts.push_back({text + " ", highlight});
  }
  WatchLine line() const { return line_; }

 private:
  WatchLine line_;
};

std::optional<double> find(const wire::HealthMessage& health, const std::string& name) {
  const auto found = health.values.find(name);
  if (found == health.values.end()) return std::nullopt;
  return found->second;
}

Highlight highlight_if(bool alarm, bool warning = false) {
  return alarm ? Highlight::kAlarm : warning ? Highlight::kWarning : Highlight::kNone;
}

void add_count(Row& row, std::optional<double> count, Highlight highlight, double limit = 0) {
  if (!count) return row.add("-");
  row.add(value_text("", *count), *count > limit ? highlight : Highlight::kNone);
}

void add_value(Row& row, const wire::HealthMessage& health, const std::string& name, double limit) {
  const auto value = find(health, name);
  if (!value) return row.add("-");
  row.add(value_text(name, *value), highlight_if(false, *value > limit));
}

void add_disk(Row& row, const wire::HealthMessage& health) {
  const auto free = find(health, "disk_free_bytes");
  if (!free) return row.add("-");
  const auto seconds = find(health, "disk_seconds_left");
  if (!seconds) return row.add(format_bytes(*free));
  row.add(duration_text(*seconds),
          highlight_if(*seconds < kAlarmDiskSeconds, *seconds < kWarnDiskSeconds));
}

void add_clock(Row& row, const wire::HealthMessage& health) {
  const auto synchronised = find(health, "clock_synchronised_flag");
  const auto offset = find(health, "clock_offset_us");
  if (!synchronised) return row.add("unknown");
  if (*synchronised == 0) return row.add("not synchron.", Highlight::kWarning);
  if (!offset) return row.add("synchronised");
  row.add(value_text("offset_us", *offset),
          highlight_if(false, std::abs(*offset) > kWarnClockOffsetUs));
}

Highlight highlight_of(wire::NodeState state) {
  return highlight_if(state == wire::NodeState::kFault);
}

/// Frames per second of the fastest camera of a node, or meshes per second of a reconstruction
/// node.
std::string rate_text(const wire::HealthMessage& health, const std::vector<std::string>& cameras) {
  if (const auto live = find(health, "live_fps")) return value_text("_fps", *live);
  double max = 0;
  for (const std::string& camera : cameras) {
    max = std::max(max, find(health, camera + ".frames_per_second").value_or(0));
  }
  return cameras.empty() ? "-" : value_text("_per_second", max);
}

void add_memory(Row& row, const wire::HealthMessage& health) {
  const auto used = find(health, "memory_daemon_bytes");
  const auto available = find(health, "memory_available_bytes");
  if (!used) return row.add("-");
  row.add(format_bytes(*used), highlight_if(false, available && *available < kWarnMemoryBytes));
}

WatchLine node_line(const std::string& node, const StudioSnapshot& state) {
  Row row;
  row.add(node);
  const auto found = state.health.find(node);
  if (found == state.health.end()) {
    row.add("silent", Highlight::kAlarm);
    WatchLine line = row.line();
    line.parts.push_back({silent_node_advice(node), Highlight::kNone});
    return line;
  }
  const wire::HealthMessage& health = found->second;
  const auto cameras = state.cameras.find(node);
  const bool meshes = find(health, "meshes").has_value();
  const std::vector<std::string> absent = absent_nodes(state.health);
  const bool is_absent = std::ranges::find(absent, node) != absent.end();
  row.add(std::string(name(health.state)),
          is_absent ? Highlight::kAlarm : highlight_of(health.state));
  row.add(rate_text(health,
                    cameras == state.cameras.end() ? std::vector<std::string>{} : cameras->second));
  add_count(row, find(health, meshes ? "dropped" : "frames_missing"),
            meshes ? Highlight::kWarning : Highlight::kAlarm);
  add_count(row, find(health, "frames_suspect"), Highlight::kAlarm);
  add_count(row, find(health, meshes ? "queue_sets" : "queue_frames"), Highlight::kWarning,
            kWarnQueue);
  add_disk(row, health);
  add_clock(row, health);
  add_value(row, health, "cpu_machine_percent", kWarnCpuPercent);
  add_memory(row, health);
  add_value(row, health, "temperature_max_celsius", kMaxPcCelsius);
  const auto latency = find(health, "latency_p50_ms");
  row.add(latency
              ? value_text("_us", *latency).substr(0, value_text("_us", *latency).size() - 2) + "ms"
              : "-");
  return row.line();
}

/// Returns also whether the camera needs attention.
std::pair<WatchLine, bool> camera_line(const std::string& camera,
                                       const wire::HealthMessage& health) {
  const auto value = [&](const char* what) { return find(health, camera + "." + what); };
  const bool streams = value("streaming_flag").value_or(0) != 0;
  Row row;
  row.add("  " + camera);
  row.add(streams ? "streaming" : "lost", highlight_if(!streams));
  row.add(value_text("_per_second", value("frames_per_second").value_or(0)));
  add_count(row, value("frames_missing"), Highlight::kAlarm);
  add_count(row, value("frames_suspect"), Highlight::kAlarm);
  add_count(row, value("queue_frames"), Highlight::kWarning, kWarnQueue);
  if (value("temperature_celsius")) {
    for (size_t i = 0; i < kColumnsOfNodes; ++i) row.add("");
    add_value(row, health, camera + ".temperature_celsius", kMaxCameraCelsius);
  }
  const WatchLine line = row.line();
  const bool needs_attention =
      std::any_of(line.parts.begin(), line.parts.end(),
                  [](const Part& part) { return part.highlight != Highlight::kNone; });
  return {line, needs_attention};
}

/// Work of one of several reconstruction nodes in the take; empty for other nodes.
std::string shard_text(const wire::HealthMessage& health) {
  const auto made = find(health, "shard_pulses");
  if (!made) return "";
  std::string text = value_text("", *made) + " meshes made by this node";
  for (const auto& [name, words] :
       {std::pair("shard_taken_over", " taken over"), std::pair("shard_repeated", " repeated"),
        std::pair("shard_lost", " lost")}) {
    const double count = find(health, name).value_or(0);
    if (count > 0) text += ", " + value_text("", count) + words;
  }
  return text;
}

/// Peaks of the sound of a node in dB of full scale, by channel, and its faults; empty without
/// sound.
WatchLine sound_line(const wire::HealthMessage& health) {
  const auto open = find(health, "sound_open_flag");
  if (!open) return {};
  if (*open == 0) return {{{"  sound: the device is not open", Highlight::kWarning}}};
  WatchLine line{{{"  sound peaks (dB)", Highlight::kNone}}};
  for (int channel = 1;; ++channel) {
    const auto peak = find(health, "sound_peak_" + std::to_string(channel) + "_db");
    if (!peak) break;
    const std::string text =
        "  " + std::to_string(channel) + ": " + value_text("", std::round(*peak));
    line.parts.push_back({text, Highlight::kNone});
  }
  for (const auto& [name, words] :
       {std::pair("sound_channels_clipping", "clipping channels"),
        std::pair("sound_channels_silent", "silent channels"), std::pair("sound_xruns", "xruns"),
        std::pair("sound_timecode_jumps", "timecode jumps")}) {
    const double count = find(health, name).value_or(0);
    if (count == 0) continue;
    line.parts.push_back(
        {std::string("  ") + words + ": " + value_text("", count), Highlight::kWarning});
  }
  return line;
}

/// State of the timecode output of a node; empty without one.
WatchLine timecode_line(const wire::HealthMessage& health) {
  const auto open = find(health, "timecode_output_open_flag");
  if (!open) return {};
  if (*open == 0) return {{{"  timecode output: the device is not open", Highlight::kWarning}}};
  WatchLine line{{{"  timecode output plays", Highlight::kNone}}};
  const double underruns = find(health, "timecode_output_underruns").value_or(0);
  if (underruns > 0) {
    line.parts.push_back({"  underruns: " + value_text("", underruns), Highlight::kWarning});
  }
  return line;
}

/// The scene of the lamps of a node; empty without lamps.
WatchLine lights_line(const wire::HealthMessage& health) {
  const auto connected = find(health, "lights_connected_flag");
  if (!connected) return {};
  if (*connected == 0) return {{{"  lights: not connected", Highlight::kWarning}}};
  const bool take = find(health, "take_light_flag").value_or(0) != 0;
  return {{{take ? "  lights: take" : "  lights: work", Highlight::kNone}}};
}

WatchLine head_line() {
  Row row;
  for (const Column& column : kColumns) row.add(column.head);
  return row.line();
}

struct Body {
  std::vector<WatchLine> lines;
  std::vector<bool> optional;  ///< cameras without a fault: dropped from a small window
};

Body body_of(const StudioSnapshot& state) {
  Body body;
  const auto add = [&](const WatchLine& line, bool optional) {
    body.lines.push_back(line);
    body.optional.push_back(optional);
  };
  for (const std::string& node : state.nodes) {
    add(node_line(node, state), false);
    const auto health = state.health.find(node);
    const auto cameras = state.cameras.find(node);
    if (health == state.health.end()) continue;
    if (!health->second.text.empty()) {
      add({{{"  " + health->second.text, Highlight::kWarning}}}, false);
    }
    for (const WatchLine& line :
         {sound_line(health->second), timecode_line(health->second), lights_line(health->second)}) {
      if (!line.parts.empty()) add(line, false);
    }
    if (const std::string shards = shard_text(health->second); !shards.empty()) {
      add({{{"  " + shards, Highlight::kNone}}}, true);
    }
    if (cameras == state.cameras.end()) continue;
    for (const std::string& camera : cameras->second) {
      const auto [line, needs_attention] = camera_line(camera, health->second);
      add(line, !needs_attention);
    }
  }
  return body;
}

void drop_optional_lines(Body& body, size_t room) {
  for (size_t i = body.lines.size(); i-- > 0 && body.lines.size() > room;) {
    if (!body.optional[i]) continue;
    body.lines.erase(body.lines.begin() + static_cast<ptrdiff_t>(i));
    body.optional.erase(body.optional.begin() + static_cast<ptrdiff_t>(i));
  }
}

/// Requires ASCII: one byte is one column.
void truncate(WatchLine& line, size_t width) {
  for (WatchLine::Part& part : line.parts) {
    part.text.resize(std::min(part.text.size(), width));
    width -= part.text.size();
  }
}

}  // namespace

std::string WatchLine::text(bool colours) const {
  std::string line;
  for (const Part& part : parts) {
    const bool coloured = colours && part.highlight != Highlight::kNone;
    if (coloured) line += part.highlight == Highlight::kAlarm ? "\033[1;31m" : "\033[33m";
    line += part.text;
    if (coloured) line += "\033[0m";
  }
  if (!colours) line.erase(line.find_last_not_of(' ') + 1);
  return line;
}

WatchLine event_line(const wire::EventMessage& event) {
  const Highlight highlight = event.severity == wire::Severity::kAlarm     ? Highlight::kAlarm
                              : event.severity == wire::Severity::kWarning ? Highlight::kWarning
                                                                           : Highlight::kNone;
  return {{{local_time(event.sent, "%H:%M:%S") + "  ", Highlight::kNone},
           {event.node + "  " + event.subject + ": ", highlight},
           {event.text, Highlight::kNone}}};
}

std::string summary_line(const StudioSnapshot& state) {
  std::string take = "idle";
  for (const auto& [node, health] : state.health) {
    if (health.take.empty()) continue;
    take = control::records_nothing(health) ? doing_text(health)
                                            : std::string(name(health.state)) + " " + health.take;
  }
  const std::string recording = recording_line(state.health);
  return take + (recording.empty() ? "" : "   " + recording);
}

std::vector<WatchLine> watch_lines(const StudioSnapshot& state, size_t width, size_t height) {
  std::vector<WatchLine> lines = {
      {{{state.studio + "   " + summary_line(state), Highlight::kNone}}}, {{}}, head_line()};
  Body body = body_of(state);
  drop_optional_lines(body, height > lines.size() ? height - lines.size() : 0);
  lines.insert(lines.end(), body.lines.begin(), body.lines.end());
  if (!state.events.empty() && lines.size() + 2 <= height) {
    lines.push_back({{}});
    const size_t room = std::min(state.events.size(), height - lines.size());
    for (auto event = state.events.end() - static_cast<ptrdiff_t>(room);
         event != state.events.end(); ++event) {
      lines.push_back(event_line(*event));
    }
  }
  lines.resize(std::min(lines.size(), height));
  for (WatchLine& line : lines) truncate(line, width);
  return lines;
}

}  // namespace v3d::ctl
