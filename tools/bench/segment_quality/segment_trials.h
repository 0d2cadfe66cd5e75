// Composite images with known silhouettes: people from one recording pasted into another room.
//
// People are cut out of studio20 by its masks at half size; the room is room4. Both are real
// images. The true silhouette is every pixel that the person covers by half or more.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "base/image/image.h"
#include "base/image/mask.h"

namespace v3d::bench {

/// Change of the image between the learnt empty room and the composite.
struct Condition {
  std::string name;
  double noise =
      1.5;          ///< standard deviation, grey values; of the plates as well: it is the camera's
  double gain = 0;  ///< relative change of brightness, alternately up and down
  double shadow = 0;  ///< part of the light that the core of the shadow loses
};

/// The conditions: clean, noise, gain change, soft shadow, and all of these together.
const std::vector<Condition>& conditions();

struct Composite {
  Image colour;  ///< RGB8
  Mask truth;
};

/// One camera of the room under one condition.
struct TrialScene {
  std::vector<Image> plates;  ///< RGB8
  std::vector<Composite> composites;
};

/// Makes one scene for each camera of the room; deterministic. `data` contains room4/ and
/// studio20/. Throws InputError with the name of a missing file.
std::vector<TrialScene> make_scenes(const std::filesystem::path& data, const Condition& condition);

// Trials of our segmenter and of OpenCV's subtractors on the composites, compared with the truth.

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
Trial our_trial(const std::vector<TrialScene>& scenes);

/// Input images of the subtractors.
enum class SubtractorInput {
  kCamera,  ///< the raw image, as our segmenter gets it; grey or demosaiced
  kColour,  ///< all three colours of every pixel, three times the data of the camera
};

/// Trials for every point of the parameter grid, in the same order for all scenes: threshold, raw
/// or demosaiced image, shadows as background or foreground, and the clean-up. `method` is "MOG2"
/// or "KNN".
std::vector<Trial> peer_trials(const std::string& method, SubtractorInput input_kind,
                               const std::vector<TrialScene>& scenes);

/// Our mask of one composite, for inspection.
Mask our_mask(const TrialScene& scene, const Composite& composite);

}  // namespace v3d::bench
