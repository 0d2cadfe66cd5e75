// Segmentations of the composites by our segmenter and by OpenCV's subtractors, against the truth.
#pragma once

#include <string>
#include <vector>

#include "segment_quality/composites.h"

namespace v3d::bench {

/// Pixels over many images.
struct Score {
  int64_t hits = 0;          ///< foreground, and said so
  int64_t false_alarms = 0;  ///< background, said to be foreground
  int64_t misses = 0;        ///< foreground, said to be background

  void add(const Mask& said, const Mask& truth);
  Score& operator+=(const Score& other);
  double precision() const;
  double recall() const;
  double f() const;  ///< the harmonic mean of both
};

struct Trial {
  std::string parameters;
  Score score;
};

/// Our segmenter as a studio runs it: raw Bayer images, default options.
Trial our_trial(const std::vector<Scene>& scenes);

/// What the subtractors are shown.
enum class Sight {
  kCamera,  ///< what ours sees: the raw image, as it is (grey) or demosaiced
  kColour,  ///< all three colours of every pixel, three times what the camera has
};

/// Every point of the grid of parameters, the same points in the same order whatever the scenes:
/// threshold, raw or demosaiced image, shadows as background or as foreground, and the clean-up.
/// `method` is "MOG2" or "KNN".
std::vector<Trial> peer_trials(const std::string& method, Sight sight,
                               const std::vector<Scene>& scenes);

/// Our mask of one composite, to look at.
Mask our_mask(const Scene& scene, const Composite& composite);

}  // namespace v3d::bench
