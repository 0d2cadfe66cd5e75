// Learns a background model: mean and standard deviation of every sample over the plates.
#include "capture/segmentation/background.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "base/core/error.h"
#include "capture/segmentation/brightness.h"

namespace v3d {
namespace {

void check(const std::vector<ImageView>& plates) {
  if (plates.size() < 2) {
    throw InputError("background: " + std::to_string(plates.size()) +
                     " plates; expected 2 or more");
  }
  for (const ImageView& plate : plates) {
    if (plate.size != plates[0].size || plate.format != plates[0].format) {
      throw InputError("background: the plates differ in size or pixel format");
    }
    if (plate.bytes.size() != byte_count(plate.size, plate.format)) {
      throw InputError("background: a plate is truncated");
    }
  }
}

/// Mean of the plates, each divided by its gain.
std::vector<float> mean_of(const std::vector<ImageView>& plates, const std::vector<float>& gains) {
  std::vector<float> mean(plates[0].bytes.size());
  for (size_t p = 0; p < plates.size(); ++p) {
    const float weight = 1 / (gains[p] * static_cast<float>(plates.size()));
    for (size_t i = 0; i < mean.size(); ++i) {
      mean[i] += weight * static_cast<float>(plates[p].bytes[i]);
    }
  }
  return mean;
}

std::vector<float> spread_of(const std::vector<ImageView>& plates, const std::vector<float>& gains,
                             const std::vector<float>& mean) {
  std::vector<float> spread(mean.size());
  for (size_t p = 0; p < plates.size(); ++p) {
    const float scale = 1 / gains[p];
    for (size_t i = 0; i < mean.size(); ++i) {
      const float d = scale * static_cast<float>(plates[p].bytes[i]) - mean[i];
      spread[i] += d * d;
    }
  }
  const auto freedom = static_cast<float>(plates.size() - 1);
  for (float& s : spread) s = std::sqrt(s / freedom);
  return spread;
}

float gain_of(ImageView plate, const std::vector<float>& mean) {
  std::vector<uint16_t> fixed(mean.size());
  std::transform(mean.begin(), mean.end(), fixed.begin(), [](float m) {
    return static_cast<uint16_t>(std::lround(std::min(m, 255.0F) * 256));
  });
  return static_cast<float>(brightness_ratio(plate, fixed)) / kUnitGain;
}

/// Rounds to the precision of the files, so that a learnt and a loaded model give the same masks.
void round_to_file(std::vector<float>& values) {
  for (float& v : values) v = std::round(std::clamp(v, 0.0F, 255.0F) * 256) / 256;
}

}  // namespace

BackgroundModel learn_background(const std::vector<ImageView>& plates) {
  check(plates);
  std::vector<float> gains(plates.size(), 1.0F);
  const std::vector<float> unscaled_mean = mean_of(plates, gains);
  std::transform(plates.begin(), plates.end(), gains.begin(),
                 [&](const ImageView& plate) { return gain_of(plate, unscaled_mean); });
  BackgroundModel model;
  model.size = plates[0].size;
  model.format = plates[0].format;
  model.mean = mean_of(plates, gains);
  model.spread = spread_of(plates, gains, model.mean);
  round_to_file(model.mean);
  round_to_file(model.spread);
  return model;
}

}  // namespace v3d
