// JPEG and PNG: adapter of libturbojpeg and libspng.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "base/image/image.h"
#include "base/image/mask.h"

namespace v3d {

// JPEG encoder and decoder, for small images on the network and in reports. The adapter of
// libjpeg-turbo.

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

// PNG encoder and decoder, for images that other programs open. The adapter of libspng.

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

enum class PngEffort {
  kNormal,
  kFast,  ///< zlib's level 1: for many images, which become a little longer
};

/// Writes a PNG file with 8 bits: grey for format Mono8, RGB for all others. Throws
/// std::runtime_error when the file cannot be written.
void write_png(const std::filesystem::path& path, ImageView image,
               PngEffort effort = PngEffort::kNormal);

// Reads PNG and JPEG files of users and converts them to RGB with 8 bits per channel.

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

/// The means of blocks of `factor` x `factor` pixels; rows and columns that fill no block are left
/// out. Requires RGB8, and at least one block.
Image reduced(const Image& picture, int factor);

/// Bilinear colour at pixel coordinates (centre of the first pixel: 0, 0).
/// The picture repeats horizontally; beyond its top and bottom the nearest row is used. Requires
/// RGB8.
void sample_picture(const Image& picture, double x, double y, uint8_t rgb[3]);

}  // namespace v3d
