// Writes a simulated take without daemons.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <vector>

#include "base/geometry/camera_model.h"
#include "v3d-sim/faults.h"

namespace v3d::sim {

struct SimulatedTake {
  std::filesystem::path folder;  ///< created; its name is the take's
  Rig rig;
  int64_t frames = 0;
  double rate_hz = 25;
  double begin_s = 0;  ///< time of the action at pulse 0
  uint64_t seed = 1;
  double colour_spread = 0;  ///< RenderOptions::colour_spread
  std::vector<Fault> faults;
  /// Masks of the frames have outline noise of this standard deviation, pixels; 0: no masks.
  double outline_noise_px = 0;
  /// Folder for 000012.ply, one per pulse, and sword/000012.ply, the blade alone.
  std::optional<std::filesystem::path> truth;
};

/// Writes the take. The middle of the exposure of pulse k is at begin_s + k / rate_hz seconds of
/// the action.
///
/// Deterministic. `progress` is called with the number of finished pulses. Throws InputError for a
/// folder that is not empty and for an invalid take name, std::runtime_error for write errors.
void write_take(const SimulatedTake& take, const std::function<void(int64_t)>& progress);

}  // namespace v3d::sim
