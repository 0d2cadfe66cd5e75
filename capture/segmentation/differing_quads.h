// Which quads of an image differ from the background: the inner loop of the segmentation.
#pragma once

#include <cstdint>
#include <vector>

#include "base/image/image.h"
#include "base/image/mask.h"
#include "capture/segmentation/background_table.h"

namespace v3d {

/// A quad is the background in another light when one factor explains all its samples: it leaves of
/// each at most `allowed` and `allowed_part` of the quad's mean.
struct LightTest {
  /// `least`, `most`, less than 2: the factor; `chroma`: `allowed_part`; `noise_floor`: of which
  /// `allowed` is a multiple, grey values.
  LightTest(float least, float most, float chroma, int channels, float noise_floor);

  uint16_t least_factor;  ///< 1/32768
  uint16_t most_factor;
  uint16_t allowed;       ///< 1/64 grey value
  uint16_t allowed_part;  ///< 1/65536; where there are three channels, a third of it
};

/// When a quad, two by two neighbouring pixels, differs. Grey values, distances and factors are
/// fixed-point numbers.
struct QuadTest {
  QuadTest(const BackgroundTable& background, const SegmentOptions& options);

  uint16_t limit;  ///< a quad differs when the sum of its samples' squared distances is beyond it
  uint16_t far;    ///< distances that are greater count as this, so that the sum fits 16 bits
  bool spares_shadows;  ///< not in grey images: they have no colour to tell a shadow by
  LightTest shadow;     ///< or a small highlight
  LightTest key;        ///< the studio's colour, in any light
};

/// Keeps its working memory between calls. One thread.
class DifferingQuads {
 public:
  explicit DifferingQuads(const BackgroundTable& background);

  /// Bit (x, y) of the result tells whether the quad of pixels x, x + 1 and rows y, y + 1 differs
  /// from the background in this image's brightness (brightness_ratio()). Bits of the last column
  /// are 1, those of the last row have no meaning. Requires: image of the background's size, at
  /// least two pixels wide and high, and of its format. Vectorised for the processor it runs on;
  /// every processor gives the same bits. The result is valid until the next call.
  const Mask& find(ImageView image, const BackgroundTable& background, const QuadTest& test,
                   uint32_t gain);

 private:
  Mask quads_;
  std::vector<uint16_t> evidence_;  ///< per pixel of the last row: squared distance
  std::vector<uint16_t> columns_;   ///< per column of the last two rows: their sum
  std::vector<uint8_t>
      tails_[2];  ///< the last rows, where reading in registers would leave the image
};

}  // namespace v3d
