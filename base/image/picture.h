// Reads PNG and JPEG files of users and converts them to RGB with 8 bits per channel.
#pragma once

#include <filesystem>

#include "base/image/image.h"
#include "base/image/mask.h"

namespace v3d {

/// Reads an RGB8 image; ignores transparency.
/// Throws InputError with the path when the file is not a complete PNG or JPEG image, or a side
/// exceeds kMaxImageSide.
Image read_picture(const std::filesystem::path& path);

/// Like read_picture(), for bytes in memory; `path` is their origin, for messages.
Image decode_picture(std::string_view bytes, const std::filesystem::path& path);

/// The silhouette in a black and white picture: pixels whose mean of R, G and B is at least 128 are
/// foreground. Requires RGB8.
Mask mask_from_picture(const Image& picture);

/// Crops the picture to the aspect ratio of `size` around its centre, as large as possible, and
/// scales it to `size` (bilinear). Requires RGB8 and a picture of at least one pixel.
Image fill_size(const Image& picture, ImageSize size);

/// Bilinear colour at pixel coordinates (centre of the first pixel: 0, 0).
/// The picture repeats horizontally; beyond its top and bottom the nearest row is used. Requires
/// RGB8.
void sample_picture(const Image& picture, double x, double y, uint8_t rgb[3]);

}  // namespace v3d
