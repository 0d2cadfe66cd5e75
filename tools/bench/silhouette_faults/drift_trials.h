// Simulated studios with a camera that was knocked, or none.
#pragma once

#include <cstdint>
#include <string>

namespace v3d::bench {

struct DriftScore {
  int clean_studios = 0;
  int false_alarms = 0;
  double largest_clean_px = 0;  ///< shift that was found where there was none
  int knocked_studios = 0;
  int named = 0;                     ///< the right camera
  int others_named = 0;              ///< a wrong one
  double least_px = 0, most_px = 0;  ///< shift that was found of the knocked cameras
};

struct DriftTrialOptions {
  uint64_t first_seed = 1;  ///< of the first studio; the others follow
  int clean = 24;
  int knocked = 24;
  bool list = false;  ///< prints every studio
};

/// Rigs of 15 XGA cameras, each a seed of its own, six pulses each, as calibrated; and with one
/// camera's silhouettes 3 pixels aside: to the right, down, to the left and up by turns.
DriftScore try_drift(const DriftTrialOptions& options);

}  // namespace v3d::bench
