// Trials of the detection of displaced cameras in simulated studios.
#pragma once

#include <cstdint>
#include <string>

namespace v3d::bench {

struct DriftScore {
  int clean_studios = 0;
  int false_alarms = 0;
  double largest_clean_px = 0;  ///< largest detected shift without a displaced camera, pixels
  int displaced_studios = 0;
  int named = 0;                  ///< studios whose displaced camera was named
  int others_named = 0;           ///< wrongly named cameras
  double min_px = 0, max_px = 0;  ///< detected shift of the displaced cameras
};

struct DriftTrialOptions {
  uint64_t first_seed = 1;  ///< seed of the first studio; others follow
  int clean = 24;
  int displaced = 24;
  bool list = false;  ///< prints every studio
};

/// Runs the trials: rigs of 15 XGA cameras with different seeds and six pulses each. `clean`
/// studios match their calibration. In `displaced` studios, the silhouettes of one camera are
/// shifted by 3 pixels: right, down, left or up.
DriftScore try_drift(const DriftTrialOptions& options);

}  // namespace v3d::bench
