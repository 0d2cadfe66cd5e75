// A small take whose only surface is tracked, without images.
#pragma once

#include <cstdint>
#include <filesystem>
#include <vector>

#include "base/geometry/mesh.h"

namespace v3d::test {

/// Pulses of a gliding take.
inline constexpr int kGlidingPulses = 6;

/// Writes take.toml, calib.toml and motion.v3d of a person who glides along x by 1 cm a pulse.
/// Creates the folder. Vertices have no colours.
void write_gliding_take(const std::filesystem::path& take, double rate_hz = 25);

/// Writes a motion file of the same person at pulses first to last - 1.
void write_gliding_motion(const std::filesystem::path& file, int first, int last);
/// The same with the pulses of each segment.
void write_gliding_motion(const std::filesystem::path& file,
                          const std::vector<std::vector<int64_t>>& segments);

/// Writes mesh.v3d, beside or instead of the motion file, with this surface at all pulses of a
/// gliding take; the last `empty` ones are empty. `labels`: the performer of each vertex, or none.
/// Every vertex must have a triangle.
void write_still_meshes(const std::filesystem::path& take, const Mesh& surface,
                        const std::vector<uint8_t>& labels, int empty = 0);

}  // namespace v3d::test
