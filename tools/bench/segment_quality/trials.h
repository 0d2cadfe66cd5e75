// Trials of our segmenter and of OpenCV's subtractors on the composites, compared with the truth.
#pragma once

#include <string>
#include <vector>

#include "segment_quality/composites.h"

namespace v3d::bench {

/// Numbers of pixels over many images.
struct Score {
  int64_t hits = 0;          ///< foreground, segmented as foreground
  int64_t false_alarms = 0;  ///< background, segmented as foreground
  int64_t misses = 0;        ///< foreground, segmented as background

  void add(const Mask& said, const Mask& truth);
  Score& operator+=(const Score& other);
  double precision() const;
  double recall() const;
  double f() const;  ///< harmonic mean of precision and recall
};

struct Trial {
  std::string parameters;
  Score score;
};

/// Our segmenter as used in a studio: raw Bayer images, default options.
Trial our_trial(const std::vector<Scene>& scenes);

/// Input images of the subtractors.
enum class SubtractorInput {
  kCamera,  ///< the raw image, as our segmenter gets it; grey or demosaiced
  kColour,  ///< all three colours of every pixel, three times the data of the camera
};

/// Trials for every point of the parameter grid, in the same order for all scenes: threshold, raw
/// or demosaiced image, shadows as background or foreground, and the clean-up. `method` is "MOG2"
/// or "KNN".
std::vector<Trial> peer_trials(const std::string& method, SubtractorInput sight,
                               const std::vector<Scene>& scenes);

/// Our mask of one composite, for inspection.
Mask our_mask(const Scene& scene, const Composite& composite);

}  // namespace v3d::bench
