// PNG encoder and decoder, for images that other programs open. The adapter of libspng.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "base/image/image.h"

namespace v3d {

/// An image of 16 bits per sample: grey (1 channel) or RGB (3 channels), packed rows from the top.
struct DeepImage {
  ImageSize size;
  int channels = 1;
  std::vector<uint16_t> samples;
};

/// Encodes a PNG file. Equal images give equal bytes. Requires 1 or 3 channels, and size.pixels() *
/// channels samples.
std::string encode_png(const DeepImage& image);
/// Decodes a PNG file of 16 bits, grey or RGB; `path` is the origin of the bytes, for messages.
/// Throws InputError with `path` for any other bytes, a damaged file, and sides above
/// kMaxImageSide. Allocates at most about 1000 times the length of `bytes`.
DeepImage decode_png(std::string_view bytes, const std::filesystem::path& path);

/// Decodes a PNG file of any kind to RGB8; ignores transparency. Otherwise like decode_png().
Image decode_rgb_png(std::string_view bytes, const std::filesystem::path& path);

/// Writes a PNG file with 8 bits, RGB; converts other formats to RGB first. Throws
/// std::runtime_error when the file cannot be written.
void write_png(const std::filesystem::path& path, ImageView image);

}  // namespace v3d
