#include <algorithm>
#include <array>

#include "base/config/toml_file.h"
#include "base/io/file.h"
#include "v3d-sim/simulated_take.h"

namespace v3d::sim {
namespace {

constexpr int64_t kMaxPulses = 1'000'000'000;
constexpr int64_t kMaxLatePulses = 100;  // the images of these pulses are kept in memory
constexpr double kMaxMs = 600'000;
constexpr double kMaxDriftPpm = 10'000;

struct Kind {
  std::string_view name;
  FaultKind kind;
  bool in_takes;
  bool in_studios;
};
constexpr std::array<Kind, 10> kKinds = {{
    {"drop", FaultKind::kDrop, true, true},
    {"duplicate", FaultKind::kDuplicate, true, true},
    {"black", FaultKind::kBlack, true, true},
    {"suspect", FaultKind::kSuspect, true, false},
    {"late", FaultKind::kLate, true, false},
    {"missed", FaultKind::kMissed, false, true},
    {"delay", FaultKind::kDelay, false, true},
    {"freeze", FaultKind::kFreeze, false, true},
    {"unplug", FaultKind::kUnplug, false, true},
    {"clock", FaultKind::kClock, false, true},
}};

FaultKind read_kind(const TomlTable& table, bool in_take) {
  const std::string name = table.text("kind");
  std::string known;
  for (const Kind& kind : kKinds) {
    if (!(in_take ? kind.in_takes : kind.in_studios)) continue;
    if (kind.name == name) return kind.kind;
    known += (known.empty() ? "" : ", ") + std::string(kind.name);
  }
  const bool is_known = std::ranges::find(kKinds, name, &Kind::name) != kKinds.end();
  const std::string wrong = !is_known ? " is unknown"
                            : in_take ? " is supported for studios only"
                                      : " is supported for takes only";
  table.fail("kind", "'" + name + "'" + wrong + "; v3d-sim " + (in_take ? "take" : "studio") +
                         " supports " + known);
}

int64_t read_integer(const TomlTable& table, std::string_view key, int64_t min, int64_t max) {
  const int64_t value = table.integer(key);
  if (value < min || value > max) {
    table.fail(key, "expected " + std::to_string(min) + " to " + std::to_string(max) + ", found " +
                        std::to_string(value));
  }
  return value;
}

double read_number(const TomlTable& table, std::string_view key, double min, double max) {
  const double value = table.number(key);
  if (!(value >= min && value <= max)) {
    table.fail(key, "expected " + toml_number(min) + " to " + toml_number(max) + ", found " +
                        toml_number(value));
  }
  return value;
}

Duration read_ms(const TomlTable& table, std::string_view key, double min) {
  return from_seconds(1e-3 * read_number(table, key, min, kMaxMs));
}

void read_clock(const TomlTable& table, Fault& fault) {
  if (!table.has("jump_ms") && !table.has("drift_ppm")) {
    table.fail_here("a clock fault needs jump_ms, drift_ppm or both");
  }
  if (table.has("jump_ms")) fault.time = read_ms(table, "jump_ms", -kMaxMs);
  if (table.has("drift_ppm")) {
    fault.drift_ppm = read_number(table, "drift_ppm", -kMaxDriftPpm, kMaxDriftPpm);
  }
}

Fault read_fault(const TomlTable& table, const Rig& rig, std::optional<int64_t> take_pulses) {
  Fault fault;
  fault.camera = table.text("camera");
  if (find_camera(rig, fault.camera) < 0) {
    table.fail("camera", "there is no camera '" + fault.camera + "'; there are " +
                             rig.front().name + " to " + rig.back().name);
  }
  fault.pulse = read_integer(table, "pulse", 0, take_pulses.value_or(kMaxPulses) - 1);
  fault.kind = read_kind(table, take_pulses.has_value());
  if (fault.kind == FaultKind::kDelay) fault.time = read_ms(table, "ms", 1);
  if (fault.kind == FaultKind::kLate)
    fault.pulses = read_integer(table, "pulses", 1, kMaxLatePulses);
  if (fault.kind == FaultKind::kFreeze) {
    fault.pulses = read_integer(table, "pulses", 1, kMaxPulses);
  }
  if (fault.kind == FaultKind::kUnplug) {
    fault.time = read_ms(table, "ms", 1);
    fault.new_clock = table.boolean_or("new_clock", false);
  }
  if (fault.kind == FaultKind::kClock) read_clock(table, fault);
  table.reject_unknown_fields();
  return fault;
}

}  // namespace

std::vector<Fault> parse_faults(std::string_view text, const std::filesystem::path& path,
                                const Rig& rig, std::optional<int64_t> take_pulses) {
  const TomlTable file = TomlTable::parse(text, path);
  std::vector<Fault> faults;
  for (const TomlTable& table : file.tables("fault")) {
    const Fault fault = read_fault(table, rig, take_pulses);
    if (std::ranges::any_of(faults, [&](const Fault& other) {
          return other.camera == fault.camera && other.pulse == fault.pulse;
        })) {
      table.fail("pulse",
                 "two faults of " + fault.camera + " at pulse " + std::to_string(fault.pulse));
    }
    faults.push_back(fault);
  }
  file.reject_unknown_fields();
  return faults;
}

std::vector<Fault> load_faults(const std::filesystem::path& path, const Rig& rig,
                               std::optional<int64_t> take_pulses) {
  return parse_faults(read_file(path), path, rig, take_pulses);
}

bool has_fault(const std::vector<Fault>& faults, const std::string& camera, int64_t pulse,
               FaultKind kind) {
  return std::ranges::any_of(faults, [&](const Fault& fault) {
    return fault.camera == camera && fault.pulse == pulse && fault.kind == kind;
  });
}

std::vector<Fault> faults_at_edges(const std::vector<Fault>& faults, const std::string& camera,
                                   int64_t empty_pulses) {
  std::vector<Fault> own;
  for (Fault fault : faults) {
    if (fault.camera != camera) continue;
    fault.pulse += empty_pulses;
    own.push_back(fault);
  }
  return own;
}

}  // namespace v3d::sim
