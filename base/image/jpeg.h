// JPEG encoder and decoder, for small images on the network and in reports. The adapter of
// libjpeg-turbo.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "base/image/image.h"

namespace v3d {

/// Encodes an image with chroma subsampling 4:2:0. `quality`: 1 to 100.
/// Equal images give equal bytes. Requires format RGB8 and an image of at least one pixel. Throws
/// std::runtime_error when libjpeg-turbo fails.
std::vector<uint8_t> encode_jpeg(ImageView rgb, int quality);

/// The image size in the header of a JPEG file. Empty for other bytes, and when a side exceeds
/// kMaxImageSide.
std::optional<ImageSize> jpeg_size(std::span<const uint8_t> jpeg);

/// Decodes to RGB8. Empty for invalid bytes, and for an image of another size than `size`.
/// Safe for untrusted bytes: allocates no more than an image of `size`.
std::optional<Image> decode_jpeg(std::span<const uint8_t> jpeg, ImageSize size);

}  // namespace v3d
