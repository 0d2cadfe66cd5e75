// Rigs that are a known way off, and what the silhouettes of the performer make of them.
#pragma once

#include <vector>

namespace v3d::bench {

struct RefineTrials {
  int studios = 6;
  int instants = 30;
  int cameras = 15;  ///< of 1024x768
};

/// Errors: root mean square distance, over the cameras, of where places in the space appear, after
/// the worlds of the two rigs are brought together; the mean over the studios.
struct RefineScore {
  bool segmented = false;  ///< the silhouettes are our own segmentation's, not the true ones
  double disturbed_px = 0;
  double before_px = 0;
  double after_px = 0;
  double worst_px = 0;          ///< after, of a studio
  double planes_before_px = 0;  ///< by how much the planes disagree, as the command reports it
  double planes_after_px = 0;
  int changed = 0;  ///< studios that were refined at all
};

std::vector<RefineScore> try_refining(const RefineTrials& trials);

}  // namespace v3d::bench
