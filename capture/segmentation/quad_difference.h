// Finds the quads of an image that differ from the background: inner loop of the segmentation.
#pragma once

#include <cstdint>
#include <vector>

#include "base/image/image.h"
#include "base/image/mask.h"
#include "capture/segmentation/background_table.h"

namespace v3d {

/// A quad is background in another light if one factor explains all its samples: the residual of
/// each is at most `allowed` plus `allowed_part` of the quad's mean.
struct LightTest {
  /// `lowest`, `highest`: range of the factor, less than 2. `chroma`: allowed_part for one channel.
  /// `noise_floor`: grey values; `allowed` is a multiple of it.
  LightTest(float lowest, float highest, float chroma, int channels, float noise_floor);

  uint16_t min_factor;  ///< 1/32768
  uint16_t max_factor;
  uint16_t allowed;       ///< 1/64 grey value
  uint16_t allowed_part;  ///< 1/65536; divided by the number of channels
};

/// Test whether a quad (2x2 neighbouring pixels) differs. Grey values, distances and factors are
/// fixed-point numbers.
struct QuadTest {
  QuadTest(const BackgroundTable& background, const SegmentOptions& options);

  uint16_t limit;  ///< a quad differs if the sum of its samples' squared distances exceeds this
  uint16_t max_distance;  ///< distances are limited to this, so that the sum fits 16 bits
  bool ignores_shadows;   ///< false for grey images: a shadow cannot be detected without colour
  LightTest shadow;       ///< for shadows and small highlights
  LightTest key;          ///< for the colour of the chroma key, in any light
};

/// Finds differing quads. Keeps its working memory between calls. Not thread-safe.
class DifferingQuads {
 public:
  explicit DifferingQuads(const BackgroundTable& background);

  /// Bit (x, y) of the result is 1 if the quad of columns x, x + 1 and rows y, y + 1 differs from
  /// the background. `gain`: brightness of the image, see brightness_ratio(). Bits of the last
  /// column are 1; those of the last row are undefined. The result is valid until the next call.
  /// Requires an image of the background's size and format, at least 2x2 pixels.
  /// Vectorised for the processor at run time; every processor gives the same bits.
  const Mask& find(ImageView image, const BackgroundTable& background, const QuadTest& test,
                   uint32_t gain);

 private:
  Mask quads_;
  std::vector<uint16_t> evidence_;  ///< per pixel of the last row: squared distance
  std::vector<uint16_t> columns_;   ///< per column: sum over the last two rows
  /// Copies of the last rows, where vector loads would read beyond the image.
  std::vector<uint8_t> tails_[2];
};

}  // namespace v3d
