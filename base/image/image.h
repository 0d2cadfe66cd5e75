// Images and their sizes.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace v3d {

// Images as cameras deliver them: packed rows in one of several pixel formats. Views do not copy.

struct ImageSize {
  int width = 0;
  int height = 0;
  friend bool operator==(const ImageSize&, const ImageSize&) = default;
  int64_t pixels() const { return int64_t{width} * height; }
};

/// Largest supported width and height, pixels. Every reader rejects larger images.
inline constexpr int kMaxImageSide = 16384;

/// A half-open rectangle of pixels: x0 <= x < x0 + width.
struct Rect {
  int x0 = 0;
  int y0 = 0;
  int width = 0;
  int height = 0;
  friend bool operator==(const Rect&, const Rect&) = default;
  bool empty() const { return width <= 0 || height <= 0; }
  bool contains(int x, int y) const {
    return x >= x0 && y >= y0 && x < x0 + width && y < y0 + height;
  }
};

/// Pixel formats; the values are those of the Pixel Format Naming Convention (GenICam PFNC 2.4). In
/// a Bayer format the two letters are the colours of the first two pixels of the first row. The
/// deep formats have 10 or 12 bits in the low bits of a little-endian 16-bit word. Only cameras and
/// logs have deep images; all processing has 8 bits (reduce_to_8_bits()).
enum class PixelFormat : uint32_t {
  kMono8 = 0x01080001,
  kBayerGR8 = 0x01080008,
  kBayerRG8 = 0x01080009,
  kBayerGB8 = 0x0108000A,
  kBayerBG8 = 0x0108000B,
  kRGB8 = 0x02180014,
  kMono10 = 0x01100003,
  kMono12 = 0x01100005,
  kBayerGR10 = 0x0110000C,
  kBayerRG10 = 0x0110000D,
  kBayerGB10 = 0x0110000E,
  kBayerBG10 = 0x0110000F,
  kBayerGR12 = 0x01100010,
  kBayerRG12 = 0x01100011,
  kBayerGB12 = 0x01100012,
  kBayerBG12 = 0x01100013,
};

int bytes_per_pixel(PixelFormat format);
/// Bits of a sample: 8, 10 or 12.
int bits_per_sample(PixelFormat format);
/// True for a format with more than 8 bits per sample.
inline bool is_deep(PixelFormat format) { return bits_per_sample(format) > 8; }
/// The format with 8 bits and the same colours: BayerRG12 gives BayerRG8.
PixelFormat reduced_to_8_bits(PixelFormat format);
bool is_bayer(PixelFormat format);
/// The PFNC name, e.g. "BayerRG8".
std::string_view name(PixelFormat format);
std::optional<PixelFormat> pixel_format_from_name(std::string_view pfnc_name);
/// Empty when `pfnc_code` is not a supported format.
std::optional<PixelFormat> pixel_format_from_code(uint32_t pfnc_code);

/// The colour of the filter over a pixel of a Bayer image: 0 red, 1 green, 2 blue. Requires
/// is_bayer().
int bayer_channel(PixelFormat format, int x, int y);

/// A view of an image that another object owns: `bytes` holds `height` rows of width *
/// bytes_per_pixel bytes, without padding.
struct ImageView {
  ImageSize size;
  PixelFormat format = PixelFormat::kMono8;
  std::span<const uint8_t> bytes;

  const uint8_t* row(int y) const {
    return bytes.data() + static_cast<size_t>(y) * size.width * bytes_per_pixel(format);
  }
};

/// An image that owns its pixels, in the layout of ImageView.
struct Image {
  ImageSize size;
  PixelFormat format = PixelFormat::kMono8;
  std::vector<uint8_t> bytes;

  Image() = default;
  /// Sets all pixels to zero.
  Image(ImageSize image_size, PixelFormat pixel_format);

  ImageView view() const { return {size, format, bytes}; }
  uint8_t* row(int y) {
    return bytes.data() + static_cast<size_t>(y) * size.width * bytes_per_pixel(format);
  }
  const uint8_t* row(int y) const { return view().row(y); }
};

/// Bytes of an image without padding.
size_t byte_count(ImageSize size, PixelFormat format);

/// Keeps the upper 8 bits of each sample of a deep image; leaves other images as they are.
/// The lower bits are cut off, not rounded, so that the result is that of the camera's own 8-bit
/// format. Values above the range of the format give 255.
void reduce_to_8_bits(Image& image);

/// Copies the part of `source` inside `rect`. Requires: `rect` lies inside the image; for Bayer
/// formats x0 and y0 are even, so that the part has the same filter pattern as the whole.
Image crop(ImageView source, Rect rect);

// Parses and formats image sizes of command-line options, such as 1024x768.

/// The sides that parse_size() accepts.
enum class Sides {
  kAny,
  kEven,  ///< even numbers only: a Bayer mosaic has tiles of 2x2 pixels
};

/// Parses "1024x768": width and height in pixels, each from 16 to kMaxImageSide.
/// Throws InputError; the message starts with `option`.
ImageSize parse_size(std::string_view text, Sides sides = Sides::kAny,
                     std::string_view option = "--size");

/// "1024x768", for any size.
std::string format_size(ImageSize size);

}  // namespace v3d
