// Faults to inject into a simulated take.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "base/camera_model.h"

namespace v3d::sim {

enum class FaultKind { kMissing, kDuplicate, kSuspect };

struct Fault {
  std::string camera;
  int64_t pulse = 0;
  FaultKind kind = FaultKind::kMissing;
};

/// [[fault]] camera = "cam03", pulse = 12, kind = "missing" | "duplicate" | "suspect". Throws
/// InputError naming file, line and field: a camera that is not in `rig`, a pulse outside [0,
/// pulses), an unknown kind, the same camera and pulse twice.
std::vector<Fault> load_faults(const std::filesystem::path& path, const Rig& rig, int64_t pulses);
std::vector<Fault> parse_faults(std::string_view text, const std::filesystem::path& path,
                                const Rig& rig, int64_t pulses);

/// Whether `faults` has this one.
bool has_fault(const std::vector<Fault>& faults, const std::string& camera, int64_t pulse,
               FaultKind kind);

}  // namespace v3d::sim
