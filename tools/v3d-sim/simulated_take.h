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
  uint64_t seed = 1;
  std::vector<Fault> faults;
  std::optional<std::filesystem::path> truth;  ///< folder for 000012.ply, one per pulse
};

/// Pulse k is at k / rate seconds of the action, the middle of its exposure. The same take gives
/// the same bytes. `progress` hears how many pulses are done. Throws InputError when the folder
/// exists and is not empty or its name is no take name, std::runtime_error when the disk refuses.
void write_take(const SimulatedTake& take, const std::function<void(int64_t)>& progress);

}  // namespace v3d::sim
