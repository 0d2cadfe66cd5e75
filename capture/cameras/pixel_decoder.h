// Decoder of images as cameras send them: unpacks samples, converts YUV and JPEG to RGB.
#pragma once

#include <cstdint>
#include <optional>
#include <span>

#include "base/image/camera_format.h"
#include "base/image/image.h"

namespace v3d::capture {

/// Meaning of the samples of a YUV image.
struct YuvCoding {
  bool is_bt709 = false;       ///< matrix of ITU-R BT.709, otherwise of BT.601
  bool is_full_range = false;  ///< 0 to 255, otherwise 16 to 235 (chroma: 16 to 240)
  friend bool operator==(const YuvCoding&, const YuvCoding&) = default;
};

/// The geometry of the images of one stream.
struct SentLayout {
  CameraFormat format;
  ImageSize size;     ///< pixels; the width is a multiple of width_step(format)
  size_t stride = 0;  ///< bytes from row to row, at least row_bytes(); not used for JPEG
  YuvCoding coding{};

  /// Bytes of a whole image, without the padding of the last row. 1 for JPEG.
  size_t byte_count() const;
};

/// The image in `bytes`, in the pixel format `layout.format.image`, without padding.
/// Empty when bytes are missing, and for JPEG that is damaged or has another size. The bytes may be
/// of any content. Pure function. Throws std::bad_alloc only.
/// YUV is converted by libyuv; the chroma of a pair of pixels applies to both.
std::optional<Image> decode_image(const SentLayout& layout, std::span<const uint8_t> bytes);

}  // namespace v3d::capture
