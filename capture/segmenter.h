// Background model and segmentation: raw image (Bayer, mono or RGB) to silhouette.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

#include "base/image.h"
#include "base/mask.h"

namespace v3d {

/// The empty studio as one camera sees it: per sample (pixel of a Bayer or mono image, channel of
/// RGB) the mean and the standard deviation over the plates, in grey values.
struct BackgroundModel {
  ImageSize size;
  PixelFormat format = PixelFormat::kMono8;
  std::vector<float> mean;
  std::vector<float> spread;
};

/// Requires at least 2 plates of one size and format; throws InputError otherwise.
BackgroundModel learn_background(const std::vector<ImageView>& plates);

/// <folder>/<camera>.mean.png and .spread.png, 16 bit, value * 256; <camera>.toml tells the pixel
/// format. Loading what was saved and saving again gives the same bytes.
void save_background(const std::filesystem::path& folder, const std::string& camera,
                     const BackgroundModel& model);
/// Throws InputError naming the file.
BackgroundModel load_background(const std::filesystem::path& folder, const std::string& camera);
bool has_background(const std::filesystem::path& folder, const std::string& camera);

struct SegmentOptions {
  float threshold = 4.5F;       ///< a sample differs when it is so many spreads from the mean
  float noise_floor = 2.0F;     ///< the least spread assumed, grey values
  float shadow_min = 0.5F;      ///< a shadow keeps at least this part of the brightness
  float shadow_chroma = 0.06F;  ///< and its colour to this much
  int min_area = 64;            ///< smaller foreground pieces are dropped, pixels
  int max_hole = 64;            ///< smaller holes are filled, pixels
};

/// Pure and deterministic; keeps its working memory between calls (no allocation in steady state).
/// One thread per segmenter.
class Segmenter {
 public:
  Segmenter(BackgroundModel model, SegmentOptions options);
  /// Requires: image of the model's size and format.
  Mask segment(ImageView image);
  const BackgroundModel& model() const { return model_; }

 private:
  BackgroundModel model_;
  SegmentOptions options_;
  // working memory is added by the implementation
};

}  // namespace v3d
