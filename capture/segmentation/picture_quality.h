// Whether a camera's pictures are well exposed and sharp.
#pragma once

#include <cstdint>
#include <vector>

#include "base/image/image.h"
#include "capture/segmentation/background.h"

namespace v3d {

struct PictureQuality {
  double clipped = 0;  ///< share of samples so bright that the camera cannot tell more (250 and up)
  double dark = 0;     ///< share of samples that are lost in the noise (up to 5)
  double mean_grey = 0;
  /// Variance of the Laplacian of the mean picture at half size, in grey values squared: falls
  /// steeply as a lens leaves its focus (Pech-Pacheco et al., "Diatom autofocusing in brightfield
  /// microscopy", 2000). Of one scene only: another scene has another.
  double focus = 0;
};

/// Gathers frames of one size and format. The frames' mean is what is judged for focus, since noise
/// would pass for detail. One thread.
class PictureStatistics {
 public:
  /// Pixels of another size or format than the first picture's are passed over.
  void add(ImageView picture);
  int64_t pictures() const { return pictures_; }
  /// All zero when there was no picture.
  PictureQuality result() const;

 private:
  ImageSize size_;
  PixelFormat format_ = PixelFormat::kMono8;
  int64_t pictures_ = 0;
  int64_t clipped_ = 0;
  int64_t dark_ = 0;
  int64_t sum_ = 0;
  std::vector<uint32_t> quads_;  ///< sums over the pictures, at half size
};

/// PictureQuality::focus of the empty studio, of which the plates are the mean.
double focus_of(const BackgroundModel& model);

}  // namespace v3d
