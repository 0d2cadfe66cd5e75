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
  int found = 0;             ///< the camera was named
  int64_t innocent = 0;      ///< silhouettes without a fault that were judged
  int64_t false_alarms = 0;  ///< of these, called faulty
  /// Voxels in which the hull differs from that of the true silhouettes, over all trials.
  int64_t wrong_before = 0;
  int64_t wrong_after = 0;
};

struct FaultTrialOptions {
  uint64_t first_seed = 1;  ///< of the first studio; the others follow
  int studios = 1;          ///< rigs of 15 XGA cameras
  int pulses = 8;           ///< instants in each
  bool list = false;        ///< prints every trial
};

/// At every instant one trial without a fault, and three of every kind: a hole, a blob, a lost
/// limb, a black camera (all for three pulses on end), a camera one pulse of 25 Hz late, one that
/// shows the pulse before a second time. Faults of fewer than 300 pixels, and cameras that hardly
/// see the performer, are passed over. Seeds say everything.
std::vector<FaultScore> try_faults(const FaultTrialOptions& options);

}  // namespace v3d::bench
