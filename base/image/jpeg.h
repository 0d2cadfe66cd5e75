// JPEG, for small pictures on the wire and for people: the one place that sees libjpeg-turbo.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "base/image/image.h"

namespace v3d {

/// `quality`: 1 to 100. Requires format RGB8 and a picture of at least one pixel. Equal pictures
/// give equal bytes.
std::vector<uint8_t> encode_jpeg(ImageView rgb, int quality);

/// Of a JPEG picture, by its head; empty for anything else, and beyond kMaxImageSide.
std::optional<ImageSize> jpeg_size(std::span<const uint8_t> jpeg);

/// RGB8. Hostile bytes give nothing, and so does a picture of another size than `size`: nothing
/// larger than that is ever allocated.
std::optional<Image> decode_jpeg(std::span<const uint8_t> jpeg, ImageSize size);

}  // namespace v3d
