// Trials of the calibration refinement on rigs with known errors.
#pragma once

#include <vector>

namespace v3d::bench {

struct RefineTrials {
  int studios = 6;
  int instants = 30;
  int cameras = 15;  ///< number of cameras of 1024x768
};

/// Mean errors over the studios. An error is the RMS distance, in pixels over all cameras, of
/// projected points between two rigs, after alignment of their world frames.
struct RefineScore {
  bool segmented = false;  ///< segmented silhouettes instead of true ones
  double disturbed_px = 0;
  double before_px = 0;
  double after_px = 0;
  double worst_px = 0;          ///< largest error of a studio after the refinement
  double planes_before_px = 0;  ///< disagreement of epipolar tangents, as the command reports it
  double planes_after_px = 0;
  int changed = 0;  ///< number of studios whose rig was changed
};

std::vector<RefineScore> try_refining(const RefineTrials& trials);

}  // namespace v3d::bench
