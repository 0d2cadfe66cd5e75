// Pictures that people bring: PNG and JPEG of any kind, as 8 bits of red, green and blue.
#pragma once

#include <filesystem>

#include "base/image/image.h"

namespace v3d {

/// RGB8; transparency is left out. Throws InputError naming the file for anything but a whole PNG
/// or JPEG of at most kMaxImageSide along a side.
Image read_picture(const std::filesystem::path& path);

/// The same of bytes; `path` is where they came from.
Image decode_picture(std::string_view bytes, const std::filesystem::path& path);

/// The largest part of the picture's middle that has the shape of `size`, brought to that size;
/// bilinear. Requires RGB8 and a picture of at least one pixel.
Image fill_size(const Image& picture, ImageSize size);

/// The colour at pixel coordinates (centre of the first pixel: 0, 0), bilinear; the picture is
/// repeated sideways and ends at its top and bottom. Requires RGB8.
void sample_picture(const Image& picture, double x, double y, uint8_t rgb[3]);

}  // namespace v3d
