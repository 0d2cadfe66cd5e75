// Background model in fixed point for the inner loop of the segmentation: three bytes a sample.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "base/image/mask.h"
#include "capture/segmentation/background.h"
#include "capture/segmentation/segment_options.h"

namespace v3d {

/// Expected value of a saturated sample, in 1/128 grey value.
inline constexpr uint16_t kMaxExpected = 255 << 7;

/// Samples are in the order of the image's bytes. kReach further ones follow, so that a vector load
/// at any sample stays inside the array.
///
/// The scales let a row be processed in 16-bit SIMD lanes. With the expected value e and the
/// image's value s in 1/128 grey value:
///   e = min(mean * gain >> 16, kMaxExpected)      (gain: see brightness_ratio())
///   distance = |s - e| * (sharpness << sharpness_shift) >> 16
/// A distance of one spread is `steps_per_spread`.
struct BackgroundTable {
  static constexpr size_t kReach = 256;

  /// Requires one mean and one spread for each sample of an image of the model's size and format.
  BackgroundTable(const BackgroundModel& model, const SegmentOptions& options);

  ImageSize size;
  PixelFormat format;
  int channels;                    ///< samples per pixel
  std::vector<uint16_t> mean;      ///< 1/256 grey value
  std::vector<uint8_t> sharpness;  ///< inverse of the spread; 255 for the minimum spread
  int sharpness_shift;
  float steps_per_spread;  ///< 4 to 8
  /// Bit (x, y): the quad of columns x, x + 1 and rows y, y + 1 has the key's colour. Size 0 x 0 if
  /// there is no key.
  Mask keyed;
};

}  // namespace v3d
