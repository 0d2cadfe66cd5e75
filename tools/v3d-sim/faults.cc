#include "v3d-sim/faults.h"

#include <algorithm>

#include "base/file.h"
#include "base/toml_file.h"

namespace v3d::sim {
namespace {

FaultKind read_kind(const TomlTable& table) {
  const std::string kind = table.text("kind");
  if (kind == "missing") {
    return FaultKind::kMissing;
  }
  if (kind == "duplicate") {
    return FaultKind::kDuplicate;
  }
  if (kind == "suspect") {
    return FaultKind::kSuspect;
  }
  table.fail("kind", "'" + kind + "' is unknown; known: missing, duplicate, suspect");
}

Fault read_fault(const TomlTable& table, const Rig& rig, int64_t pulses) {
  const Fault fault{table.text("camera"), table.integer("pulse"), read_kind(table)};
  if (find_camera(rig, fault.camera) < 0) {
    table.fail("camera", "there is no camera '" + fault.camera + "'; there are " +
                             rig.front().name + " to " + rig.back().name);
  }
  if (fault.pulse < 0 || fault.pulse >= pulses) {
    table.fail("pulse", "expected 0 to " + std::to_string(pulses - 1) + ", found " +
                            std::to_string(fault.pulse));
  }
  table.refuse_unknown();
  return fault;
}

}  // namespace

std::vector<Fault> parse_faults(std::string_view text, const std::filesystem::path& path,
                                const Rig& rig, int64_t pulses) {
  const TomlTable file = TomlTable::parse(text, path);
  std::vector<Fault> faults;
  for (const TomlTable& table : file.tables("fault")) {
    const Fault fault = read_fault(table, rig, pulses);
    if (std::ranges::any_of(faults, [&](const Fault& other) {
          return other.camera == fault.camera && other.pulse == fault.pulse;
        })) {
      table.fail("pulse",
                 "two faults of " + fault.camera + " at pulse " + std::to_string(fault.pulse));
    }
    faults.push_back(fault);
  }
  file.refuse_unknown();
  return faults;
}

std::vector<Fault> load_faults(const std::filesystem::path& path, const Rig& rig, int64_t pulses) {
  return parse_faults(read_file(path), path, rig, pulses);
}

bool has_fault(const std::vector<Fault>& faults, const std::string& camera, int64_t pulse,
               FaultKind kind) {
  return std::ranges::any_of(faults, [&](const Fault& fault) {
    return fault.camera == camera && fault.pulse == pulse && fault.kind == kind;
  });
}

}  // namespace v3d::sim
