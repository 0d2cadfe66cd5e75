// Faults put into the true silhouettes of the simulated performer, and what the mender makes of
// them.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace v3d::bench {

struct FaultScore {
  std::string kind;
  int trials = 0;
  int found = 0;         ///< the camera was named
  int false_alarms = 0;  ///< faults of other cameras
  /// Voxels in which the hull differs from that of the true silhouettes, over all trials.
  int64_t wrong_before = 0;
  int64_t wrong_after = 0;
};

/// `pulses` instants of 15 XGA cameras; at each none, and three of every kind: a hole, a blob, a
/// lost limb, a black camera, a camera one pulse of 25 Hz late. Faults of fewer than 300 pixels,
/// and cameras that hardly see the performer, are passed over. Fixed seed.
std::vector<FaultScore> try_faults(int pulses);

}  // namespace v3d::bench
