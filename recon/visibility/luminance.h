// Brightness image for template matching, the input of the photometric force.
#pragma once

#include <cstdint>
#include <vector>

#include "base/image/frame.h"

namespace v3d {

/// Brightness (R + 2 G + B) / 4 of the pixels of a frame's roi, with a border that repeats its
/// edge. A Bayer mosaic is filtered with the binomial 3 x 3 kernel, which weights all colours
/// equally at every pixel, so no pattern of the mosaic remains.
///
/// Immutable; any thread.
class Luminance {
 public:
  static constexpr int kBorder = 24;  ///< pixels on each side

  Luminance() = default;
  /// Requires a frame with pixels: its roi is not empty.
  explicit Luminance(const Frame& frame);
  /// Half the resolution: means of 2 x 2 pixels.
  Luminance halved() const;

  /// Pixels of this image per pixel of the camera: 1, 0.5, ...
  float scale() const { return scale_; }
  /// A place in the image of the camera, (0.5, 0.5) in the centre of its first pixel, times
  /// scale(), minus (first_u(), first_v()), is the place in this lattice of pixel centres.
  float first_u() const { return first_u_; }
  float first_v() const { return first_v_; }
  int width() const { return width_; }
  int height() const { return height_; }
  /// Row by row: the brightness at (x, y), (x + 1, y), (x, y + 1), (x + 1, y + 1), the first in the
  /// lowest byte, so that one load is enough to interpolate. The last column and row repeat the
  /// ones before.
  const uint32_t* quads() const { return quads_.data(); }

 private:
  void put_together(const std::vector<uint8_t>& inner, int width, int height);

  float scale_ = 1;
  float first_u_ = 0, first_v_ = 0;
  int width_ = 0, height_ = 0;
  std::vector<uint32_t> quads_;
};

}  // namespace v3d
