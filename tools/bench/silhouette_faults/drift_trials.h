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
  double least_px = 0, most_px = 0;  ///< shift that was found of the knocked cameras
};

/// `studios` rigs of 15 XGA cameras, each a seed of its own, six pulses each; every one as it is,
/// and once with one camera's silhouettes 3 pixels aside.
DriftScore try_drift(int studios);

}  // namespace v3d::bench
