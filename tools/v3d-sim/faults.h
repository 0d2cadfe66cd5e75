// Fault scripts: what shall go wrong in a simulated take or studio.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/camera_model.h"
#include "sim/fault.h"

namespace v3d::sim {

/// A TOML file with [[fault]] tables: camera = "cam03", pulse = 12, kind = "drop" and what the kind
/// asks for (v3d-sim(1) has them all). `take_pulses`: of the take that is written without daemons,
/// which can have drop, duplicate, black, suspect and late; empty for a studio, whose cameras play
/// all but the last two. Throws InputError naming file, line and field: a camera that is not in
/// `rig`, a pulse outside the take, a kind that is unknown or not played here, a value that is
/// missing, out of range or not of this kind, two faults of a camera at one pulse.
std::vector<Fault> load_faults(const std::filesystem::path& path, const Rig& rig,
                               std::optional<int64_t> take_pulses);
std::vector<Fault> parse_faults(std::string_view text, const std::filesystem::path& path,
                                const Rig& rig, std::optional<int64_t> take_pulses);

/// Whether `faults` has this one.
bool has_fault(const std::vector<Fault>& faults, const std::string& camera, int64_t pulse,
               FaultKind kind);

/// The faults of one camera, their pulses counted from edge 0 of the cable: pulse 0 of a script is
/// the first edge after `empty_pulses`.
std::vector<Fault> faults_at_edges(const std::vector<Fault>& faults, const std::string& camera,
                                   int64_t empty_pulses);

}  // namespace v3d::sim
