// Background model and segmentation: raw image (Bayer, mono or RGB) to silhouette.
#pragma once

#include <cstdint>
#include <filesystem>
#include <span>
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

/// Requires at least 2 plates of one size and format; throws InputError otherwise. Plates that are
/// brighter or darker than the others as a whole (flicker) are brought to the same brightness
/// first.
BackgroundModel learn_background(const std::vector<ImageView>& plates);

/// <folder>/<camera>.mean.png and .spread.png, 16 bit, value * 256; <camera>.toml tells the pixel
/// format. Loading what was saved and saving again gives the same bytes.
void save_background(const std::filesystem::path& folder, const std::string& camera,
                     const BackgroundModel& model);
/// Throws InputError naming the file.
BackgroundModel load_background(const std::filesystem::path& folder, const std::string& camera);
bool has_background(const std::filesystem::path& folder, const std::string& camera);

struct SegmentOptions {
  float threshold = 4.5F;    ///< a sample differs when it is so many spreads from the mean
  float noise_floor = 2.0F;  ///< the least spread assumed, grey values
  float shake = 0.35F;  ///< pixels that the camera may have moved since the plates count one spread
  float shadow_min = 0.5F;      ///< a shadow keeps at least this part of the brightness
  float shadow_chroma = 0.06F;  ///< and its colour to this much
  int moved = 4;      ///< pieces that show background from up to so many pixels away are background
  int min_area = 64;  ///< smaller foreground pieces are dropped, pixels
  int max_hole = 160;  ///< smaller holes are filled, pixels
};

/// Pure and deterministic; keeps its working memory between calls (no allocation in steady state
/// but the mask). One thread per segmenter.
///
/// Evidence is joint: what counts is a quad, two by two neighbouring pixels, which in a Bayer image
/// holds every colour. A quad differs when the sum of its squared distances from the mean, in
/// spreads, is as improbable as one sample `threshold` spreads away. A pixel is foreground when all
/// quads it belongs to differ, which leaves straight edges and single-pixel lines where they are.
/// A quad whose samples all kept the same part of their brightness is a shadow (or a small
/// highlight) and does not differ; grey images have no colour to tell a shadow by, so there a
/// shadow is foreground. The image's brightness as a whole is brought to that of the model first.
/// Pieces of foreground that are background which moved a little (drop_moved_background()) go.
class Segmenter {
 public:
  Segmenter(BackgroundModel model, SegmentOptions options);
  /// Requires: image of the model's size and format.
  Mask segment(ImageView image);
  const BackgroundModel& model() const { return model_; }

 private:
  /// What is kept of one row of the image while the quads below and above it are looked at.
  struct Row {
    std::vector<uint16_t> expected;  ///< per sample: the mean in this image's brightness, 1/128
    std::vector<uint16_t> evidence;  ///< per pixel: squared distance, in (1/8 spread)^2
  };

  void measure_row(ImageView image, int y, uint32_t gain, Row& row);
  void find_quads(const Row& upper, const Row& lower, std::span<uint64_t> differs);
  void combine_quads(Mask& mask) const;

  BackgroundModel model_;
  SegmentOptions options_;
  int channels_ = 1;                 ///< samples per pixel
  uint16_t quad_limit_ = 0;          ///< sum of evidence beyond which a quad differs
  std::vector<uint16_t> mean_;       ///< per sample, 1/256 grey value
  std::vector<uint16_t> sharpness_;  ///< per sample, 4096 / spread
  Row rows_[2];
  Mask quads_;  ///< bit (x, y): the quad of pixels x, x + 1 and rows y, y + 1 differs
  std::vector<uint16_t> squares_;
  std::vector<uint8_t> flags_;
};

}  // namespace v3d
