// Fault scripts for simulated takes and studios.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/geometry/camera_model.h"
#include "sim/cameras/fault.h"

namespace v3d::sim {

/// Reads a TOML file with [[fault]] tables: camera = "cam03", pulse = 12, kind = "drop", and the
/// fields of the kind (see v3d-sim(1)).
///
/// `take_pulses`: number of pulses of a take that is written without daemons, which supports drop,
/// duplicate, black, suspect and late; empty for a studio, which supports all kinds but the last
/// two. Throws InputError with file, line and field for unknown cameras, pulses outside the take,
/// unknown or unsupported kinds, missing or invalid values, and two faults of a camera at one
/// pulse.
std::vector<Fault> load_faults(const std::filesystem::path& path, const Rig& rig,
                               std::optional<int64_t> take_pulses);
std::vector<Fault> parse_faults(std::string_view text, const std::filesystem::path& path,
                                const Rig& rig, std::optional<int64_t> take_pulses);

/// Whether `faults` contains this fault.
bool has_fault(const std::vector<Fault>& faults, const std::string& camera, int64_t pulse,
               FaultKind kind);

/// The faults of one camera with pulses converted to edge numbers of the cable. Pulse 0 of the
/// script is the first edge after `empty_pulses`.
std::vector<Fault> faults_at_edges(const std::vector<Fault>& faults, const std::string& camera,
                                   int64_t empty_pulses);

}  // namespace v3d::sim
