// Tracked surfaces of a take as bodies with a skin.
#pragma once

#include <cstdint>
#include <filesystem>
#include <span>
#include <vector>

#include "recon/skeleton/tracked_skeleton.h"

namespace v3d::ctl {

/// The segments of a motion file at the given pulses (ascending), with the colours of the rest
/// pulse. Segments of fewer than three such pulses are left out. Throws InputError for a damaged
/// file.
std::vector<recon::TrackedBody> read_tracked_bodies(const std::filesystem::path& file,
                                                    std::span<const int64_t> pulses);

/// Distances of limbs that the skeleton moves from the tracked surface.
struct SkinError {
  double p50_mm = 0, p90_mm = 0;
  int64_t pulses = 0;
};

/// Over all vertices of arms and legs at all pulses. `numbers`: the pulse of each evidence of the
/// structure.
SkinError skin_error(std::span<const recon::TrackedBody> bodies, std::span<const recon::Skin> skins,
                     const recon::KinematicStructure& structure, std::span<const int64_t> numbers);

}  // namespace v3d::ctl
