// The background as the inner loop of the segmentation reads it: three bytes a sample.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "base/image/mask.h"
#include "capture/segmentation/background.h"
#include "capture/segmentation/segment_options.h"

namespace v3d {

/// What the brightest sample shows: where the light is more, the sensor saturates.
inline constexpr uint16_t kMaxExpected = 255 << 7;

/// Samples in the order of the image's bytes, and kReach more, so that a whole register may be read
/// from any sample on.
///
/// The scales are chosen so that a row is worked through in 16-bit lanes. What the image should
/// show, e, and what it shows, s, are in 1/128 grey value:
///   e = min(mean * gain >> 16, kMaxExpected)      (gain: see brightness_ratio())
///   distance = |s - e| * (sharpness << sharpness_shift) >> 16
/// so distances are counted in `steps_per_spread` to the spread.
struct BackgroundTable {
  static constexpr size_t kReach = 256;

  /// Requires a spread per mean, and as many as an image of the model's size and format has.
  BackgroundTable(const BackgroundModel& model, const SegmentOptions& options);

  ImageSize size;
  PixelFormat format;
  int channels;                    ///< samples per pixel
  std::vector<uint16_t> mean;      ///< 1/256 grey value
  std::vector<uint8_t> sharpness;  ///< the inverse of the spread; the least spread has 255
  int sharpness_shift;
  float steps_per_spread;  ///< 4 to 8
  /// Bit (x, y): the quad of pixels x, x + 1 and rows y, y + 1 has the key's colour. Of size 0 x 0
  /// without a key.
  Mask keyed;
};

}  // namespace v3d
