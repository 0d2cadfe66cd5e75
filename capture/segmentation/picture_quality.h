// Exposure and focus measures of a camera's images.
#pragma once

#include <cstdint>
#include <vector>

#include "base/image/image.h"
#include "capture/segmentation/background.h"

namespace v3d {

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
  /// Adds an image. Ignores it if its size or format differs from the first one's.
  void add(ImageView picture);
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

}  // namespace v3d
