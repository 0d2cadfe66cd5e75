// A take without daemons: what the studio would have recorded.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <vector>

#include "base/camera_model.h"
#include "v3d-sim/faults.h"

namespace v3d::sim {

struct SimulatedTake {
  std::filesystem::path folder;  ///< created; its name is the take's
  Rig rig;
  int64_t frames = 0;
  double rate_hz = 25;
  double begin_s = 0;  ///< of the action, at pulse 0
  uint64_t seed = 1;
  double colour_spread = 0;  ///< RenderOptions::colour_spread
  std::vector<Fault> faults;
  /// Frames get masks, our segmentation's with_outline_noise() of so many pixels; 0: no masks.
  double outline_noise_px = 0;
  /// Folder for 000012.ply, one per pulse, and sword/000012.ply, the blade alone.
  std::optional<std::filesystem::path> truth;
};

/// Pulse k is at begin + k / rate seconds of the action, the middle of its exposure. The same take
/// gives the same bytes. `progress` hears how many pulses are done. Throws InputError when the
/// folder exists and is not empty or its name is no take name, std::runtime_error when the disk
/// refuses.
void write_take(const SimulatedTake& take, const std::function<void(int64_t)>& progress);

}  // namespace v3d::sim
