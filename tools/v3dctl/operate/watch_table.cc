#include "v3dctl/operate/watch_table.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "base/units.h"
#include "common/local_time.h"
#include "v3dctl/operate/health_text.h"
#include "v3dctl/operate/reply_text.h"

namespace v3d::ctl {
namespace {

// From where on a person should look.
constexpr double kDeepQueue = 8;         // frames behind one camera, of 32
constexpr double kLittleDisk = 600;      // seconds of recording
constexpr double kVeryLittleDisk = 60;   //
constexpr double kClockOffsetUs = 1000;  // a tenth of an exposure's distance from the next
constexpr double kHot = 85;              // degrees
constexpr double kBusy = 95;             // per cent
constexpr double kLittleMemory = 500e6;  // bytes

using Part = WatchLine::Part;

struct Column {
  const char* head;
  size_t width;
};
constexpr Column kColumns[] = {{"", 14},       {"STATE", 10}, {"RATE", 8},  {"MISSING", 8},
                               {"SUSPECT", 8}, {"QUEUE", 6},  {"DISK", 10}, {"CLOCK", 15},
                               {"CPU", 6},     {"MEMORY", 9}, {"TEMP", 5},  {"LATENCY", 8}};
constexpr size_t kFirstRight = 2;  // the names and states before it stand to the left

class Row {
 public:
  void add(std::string text, Look look = Look::kNone) {
    const Column& column = kColumns[line_.parts.size()];
    const size_t fill = column.width - std::min(column.width, text.size());
    if (line_.parts.size() < kFirstRight) {
      text += std::string(fill, ' ');
    } else {
      text = std::string(fill, ' ') + text;
    }
    line_.parts.push_back({text + " ", look});
  }
  WatchLine line() const { return line_; }

 private:
  WatchLine line_;
};

std::optional<double> find(const HealthMessage& health, const std::string& name) {
  const auto found = health.values.find(name);
  if (found == health.values.end()) return std::nullopt;
  return found->second;
}

Look when(bool alarm, bool warning = false) {
  return alarm ? Look::kAlarm : warning ? Look::kWarning : Look::kNone;
}

void add_count(Row& row, std::optional<double> count, Look look_when_more, double more_than = 0) {
  if (!count) return row.add("-");
  row.add(value_text("", *count), *count > more_than ? look_when_more : Look::kNone);
}

void add_value(Row& row, const HealthMessage& health, const std::string& name, double look_above) {
  const auto value = find(health, name);
  if (!value) return row.add("-");
  row.add(value_text(name, *value), when(false, *value > look_above));
}

void add_disk(Row& row, const HealthMessage& health) {
  const auto free = find(health, "disk_free_bytes");
  if (!free) return row.add("-");
  const auto seconds = find(health, "disk_seconds_left");
  if (!seconds) return row.add(format_bytes(*free));
  row.add(duration_text(*seconds), when(*seconds < kVeryLittleDisk, *seconds < kLittleDisk));
}

void add_clock(Row& row, const HealthMessage& health) {
  const auto synchronised = find(health, "clock_synchronised_flag");
  const auto offset = find(health, "clock_offset_us");
  if (!synchronised) return row.add("unknown");
  if (*synchronised == 0) return row.add("not synchron.", Look::kWarning);
  if (!offset) return row.add("synchronised");
  row.add(value_text("offset_us", *offset), when(false, std::abs(*offset) > kClockOffsetUs));
}

Look look_at(NodeState state) { return when(state == NodeState::kFault); }

/// Frames a second, of one camera: those of a node are those of its cameras.
std::string rate_of(const HealthMessage& health, const std::vector<std::string>& cameras) {
  if (const auto live = find(health, "live_fps")) return value_text("_fps", *live);
  double most = 0;
  for (const std::string& camera : cameras) {
    most = std::max(most, find(health, camera + ".frames_per_second").value_or(0));
  }
  return cameras.empty() ? "-" : value_text("_per_second", most);
}

void add_memory(Row& row, const HealthMessage& health) {
  const auto used = find(health, "memory_daemon_bytes");
  const auto available = find(health, "memory_available_bytes");
  if (!used) return row.add("-");
  row.add(format_bytes(*used), when(false, available && *available < kLittleMemory));
}

WatchLine node_line(const std::string& node, const StudioView& view) {
  Row row;
  row.add(node);
  const auto found = view.health.find(node);
  if (found == view.health.end()) {
    row.add("silent", Look::kAlarm);
    WatchLine line = row.line();
    line.parts.push_back({"Try: systemctl status v3d-studio.target on " + node, Look::kNone});
    return line;
  }
  const HealthMessage& health = found->second;
  const auto cameras = view.cameras.find(node);
  const bool meshes = find(health, "meshes").has_value();
  row.add(std::string(name(health.state)), look_at(health.state));
  row.add(rate_of(health,
                  cameras == view.cameras.end() ? std::vector<std::string>{} : cameras->second));
  add_count(row, find(health, meshes ? "dropped" : "frames_missing"),
            meshes ? Look::kWarning : Look::kAlarm);
  add_count(row, find(health, "frames_suspect"), Look::kAlarm);
  add_count(row, find(health, meshes ? "queue_sets" : "queue_frames"), Look::kWarning, kDeepQueue);
  add_disk(row, health);
  add_clock(row, health);
  add_value(row, health, "cpu_machine_percent", kBusy);
  add_memory(row, health);
  add_value(row, health, "temperature_max_celsius", kHot);
  const auto latency = find(health, "latency_p50_ms");
  row.add(latency
              ? value_text("_us", *latency).substr(0, value_text("_us", *latency).size() - 2) + "ms"
              : "-");
  return row.line();
}

/// Whether somebody has to look at it comes with it.
std::pair<WatchLine, bool> camera_line(const std::string& camera, const HealthMessage& health) {
  const auto value = [&](const char* what) { return find(health, camera + "." + what); };
  const bool streams = value("streaming_flag").value_or(0) != 0;
  Row row;
  row.add("  " + camera);
  row.add(streams ? "streaming" : "lost", when(!streams));
  row.add(value_text("_per_second", value("frames_per_second").value_or(0)));
  add_count(row, value("frames_missing"), Look::kAlarm);
  add_count(row, value("frames_suspect"), Look::kAlarm);
  add_count(row, value("queue_frames"), Look::kWarning, kDeepQueue);
  const WatchLine line = row.line();
  const bool look = std::any_of(line.parts.begin(), line.parts.end(),
                                [](const Part& part) { return part.look != Look::kNone; });
  return {line, look};
}

/// What one of several nodes that reconstruct did of the take; empty for others.
std::string share_text(const HealthMessage& health) {
  const auto made = find(health, "shard_pulses");
  if (!made) return "";
  std::string text = value_text("", *made) + " meshes made here";
  for (const auto& [name, words] :
       {std::pair("shard_taken_over", " taken over"), std::pair("shard_repeated", " made again"),
        std::pair("shard_lost", " lost")}) {
    const double count = find(health, name).value_or(0);
    if (count > 0) text += ", " + value_text("", count) + words;
  }
  return text;
}

WatchLine head_line() {
  Row row;
  for (const Column& column : kColumns) row.add(column.head);
  return row.line();
}

struct Body {
  std::vector<WatchLine> lines;
  std::vector<bool> may_go;  ///< cameras that are well, when the window is too small
};

Body body_of(const StudioView& view) {
  Body body;
  const auto add = [&](const WatchLine& line, bool may_go) {
    body.lines.push_back(line);
    body.may_go.push_back(may_go);
  };
  for (const std::string& node : view.nodes) {
    add(node_line(node, view), false);
    const auto health = view.health.find(node);
    const auto cameras = view.cameras.find(node);
    if (health == view.health.end()) continue;
    if (!health->second.text.empty()) {
      add({{{"  " + health->second.text, Look::kWarning}}}, false);
    }
    if (const std::string share = share_text(health->second); !share.empty()) {
      add({{{"  " + share, Look::kNone}}}, true);
    }
    if (cameras == view.cameras.end()) continue;
    for (const std::string& camera : cameras->second) {
      const auto [line, look] = camera_line(camera, health->second);
      add(line, !look);
    }
  }
  return body;
}

void drop_from_the_end(Body& body, size_t room) {
  for (size_t i = body.lines.size(); i-- > 0 && body.lines.size() > room;) {
    if (!body.may_go[i]) continue;
    body.lines.erase(body.lines.begin() + static_cast<ptrdiff_t>(i));
    body.may_go.erase(body.may_go.begin() + static_cast<ptrdiff_t>(i));
  }
}

/// Texts are ASCII: a byte is a column.
void cut(WatchLine& line, size_t width) {
  for (WatchLine::Part& part : line.parts) {
    part.text.resize(std::min(part.text.size(), width));
    width -= part.text.size();
  }
}

}  // namespace

std::string WatchLine::text(bool colours) const {
  std::string line;
  for (const Part& part : parts) {
    const bool coloured = colours && part.look != Look::kNone;
    if (coloured) line += part.look == Look::kAlarm ? "\033[1;31m" : "\033[33m";
    line += part.text;
    if (coloured) line += "\033[0m";
  }
  if (!colours) line.erase(line.find_last_not_of(' ') + 1);
  return line;
}

WatchLine event_line(const EventMessage& event) {
  const Look look = event.severity == Severity::kAlarm     ? Look::kAlarm
                    : event.severity == Severity::kWarning ? Look::kWarning
                                                           : Look::kNone;
  return {{{local_time(event.sent, "%H:%M:%S") + "  ", Look::kNone},
           {event.node + "  " + event.subject + ": ", look},
           {event.text, Look::kNone}}};
}

std::string summary_line(const StudioView& view) {
  std::string take = "idle";
  for (const auto& [node, health] : view.health) {
    if (!health.take.empty()) take = std::string(name(health.state)) + " " + health.take;
  }
  const std::string recording = recording_line(view.health);
  return take + (recording.empty() ? "" : "   " + recording);
}

std::vector<WatchLine> watch_lines(const StudioView& view, size_t width, size_t height) {
  std::vector<WatchLine> lines = {
      {{{view.studio + "   " + summary_line(view), Look::kNone}}}, {{}}, head_line()};
  Body body = body_of(view);
  drop_from_the_end(body, height > lines.size() ? height - lines.size() : 0);
  lines.insert(lines.end(), body.lines.begin(), body.lines.end());
  if (!view.events.empty() && lines.size() + 2 <= height) {
    lines.push_back({{}});
    const size_t room = std::min(view.events.size(), height - lines.size());
    for (auto event = view.events.end() - static_cast<ptrdiff_t>(room); event != view.events.end();
         ++event) {
      lines.push_back(event_line(*event));
    }
  }
  lines.resize(std::min(lines.size(), height));
  for (WatchLine& line : lines) cut(line, width);
  return lines;
}

}  // namespace v3d::ctl
