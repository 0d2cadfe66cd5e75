// Brightness, exposure and focus.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "base/image/image.h"
#include "capture/segmentation/background.h"

namespace v3d::segmentation {

// Brightness ratio of an image to its background model.

inline constexpr uint32_t kUnitGain =
    32768;  ///< brightness ratios are fixed-point numbers of 1/32768

/// Mode of the ratios of the image's samples to `mean` (per sample, 1/256 grey value), in units of
/// 1 / kUnitGain, limited to [0.5, 1.9]. It uses a regular subset of the samples. Samples of the
/// performer have scattered ratios and do not change the mode. kUnitGain if there are too few
/// usable samples. Pure function.
uint32_t brightness_ratio(ImageView image, std::span<const uint16_t> mean);

// Exposure and focus measures of a camera's images.

struct PictureQuality {
  double clipped = 0;    ///< share of saturated samples (250 and above)
  double dark = 0;       ///< share of samples within the noise (up to 5)
  double mean_grey = 0;  ///< grey value
  /// Variance of the Laplacian of the mean image at half size, in grey values squared. It falls
  /// steeply when the lens is out of focus. Values of different scenes are not comparable.
  /// Source: Pech-Pacheco et al., "Diatom autofocusing in brightfield microscopy", 2000.
  double focus = 0;
};

/// Accumulates images of one size and format. Focus is measured on their mean, because noise of a
/// single image would count as detail. Not thread-safe.
class PictureStatistics {
 public:
  /// Adds an image. Ignores it if its size or format differs from the first one's. Returns its mean
  /// grey value; 0 for an ignored image.
  double add(ImageView picture);
  int64_t pictures() const { return pictures_; }
  /// All zero if there was no image.
  PictureQuality result() const;

 private:
  ImageSize size_;
  PixelFormat format_ = PixelFormat::kMono8;
  int64_t pictures_ = 0;
  int64_t clipped_ = 0;
  int64_t dark_ = 0;
  int64_t sum_ = 0;
  std::vector<uint32_t> quads_;  ///< sums over the images, at half size
};

/// PictureQuality::focus of the empty studio, measured on the model's means.
double focus_of(const BackgroundModel& model);

}  // namespace v3d::segmentation
