// PNG, for pictures that people open: the one place that sees libspng.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "base/image/image.h"

namespace v3d {

/// Grey (1 channel) or red, green, blue (3 channels), 16 bits each: rows from the top, packed.
struct DeepImage {
  ImageSize size;
  int channels = 1;
  std::vector<uint16_t> samples;
};

/// Equal images give equal bytes. Requires 1 or 3 channels and as many samples as the size says.
std::string encode_png(const DeepImage& image);
/// Throws InputError naming `path` (where the bytes came from) for anything but a whole PNG of 16
/// bits, grey or RGB, of at most kMaxImageSide along a side. Takes no more memory than a thousand
/// times the bytes.
DeepImage decode_png(std::string_view bytes, const std::filesystem::path& path);

/// RGB8 of a PNG of any kind; transparency is left out. Else as decode_png().
Image decode_rgb_png(std::string_view bytes, const std::filesystem::path& path);

/// 8 bits, RGB; other formats are brought to RGB first. Throws std::runtime_error when the file
/// cannot be written.
void write_png(const std::filesystem::path& path, ImageView image);

}  // namespace v3d
