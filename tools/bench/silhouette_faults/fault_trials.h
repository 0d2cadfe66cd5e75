// Trials of silhouette repair with faults in the true silhouettes of the simulated performer.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace v3d::bench {

struct FaultScore {
  std::string kind;
  int trials = 0;
  int found = 0;             ///< trials whose faulty camera was named
  int64_t innocent = 0;      ///< silhouettes without a fault
  int64_t false_alarms = 0;  ///< silhouettes without a fault that were reported as faulty
  /// Differing voxels between the hull and that of the true silhouettes, before and after repair,
  /// over all trials.
  int64_t wrong_before = 0;
  int64_t wrong_after = 0;
};

struct FaultTrialOptions {
  uint64_t first_seed = 1;  ///< seed of the first studio; others follow
  int studios = 1;          ///< number of rigs of 15 XGA cameras
  int pulses = 8;           ///< instants in each studio
  bool list = false;        ///< prints every trial
};

/// Runs, at every instant, one trial without a fault and three of every kind. Kinds are a hole, a
/// blob, a lost limb and a black camera (each for all pulses of the trial), a camera one pulse of
/// 25 Hz late, and a repeated frame. Faults of fewer than 300 pixels, and cameras that hardly see
/// the performer, are skipped. The result depends only on the seeds.
std::vector<FaultScore> try_faults(const FaultTrialOptions& options);

}  // namespace v3d::bench
