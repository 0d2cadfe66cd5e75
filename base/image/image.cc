#include "base/image/image.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cstring>

#include "base/core/error.h"

namespace v3d {
namespace {

using Tile = std::array<int, 4>;
constexpr Tile kNoTile = {-1, -1, -1, -1};
constexpr Tile kGR = {1, 0, 2, 1};
constexpr Tile kRG = {0, 1, 1, 2};
constexpr Tile kGB = {1, 2, 0, 1};
constexpr Tile kBG = {2, 1, 1, 0};

struct FormatInfo {
  PixelFormat format;
  std::string_view pfnc_name;
  int bytes_per_pixel;
  int bits_per_sample;
  Tile tile;  ///< colours of the 2x2 tile, row-major; kNoTile for formats without a mosaic
  PixelFormat reduced;
};

constexpr std::array<FormatInfo, 16> kFormats = {{
    {PixelFormat::kMono8, "Mono8", 1, 8, kNoTile, PixelFormat::kMono8},
    {PixelFormat::kBayerGR8, "BayerGR8", 1, 8, kGR, PixelFormat::kBayerGR8},
    {PixelFormat::kBayerRG8, "BayerRG8", 1, 8, kRG, PixelFormat::kBayerRG8},
    {PixelFormat::kBayerGB8, "BayerGB8", 1, 8, kGB, PixelFormat::kBayerGB8},
    {PixelFormat::kBayerBG8, "BayerBG8", 1, 8, kBG, PixelFormat::kBayerBG8},
    {PixelFormat::kRGB8, "RGB8", 3, 8, kNoTile, PixelFormat::kRGB8},
    {PixelFormat::kMono10, "Mono10", 2, 10, kNoTile, PixelFormat::kMono8},
    {PixelFormat::kMono12, "Mono12", 2, 12, kNoTile, PixelFormat::kMono8},
    {PixelFormat::kBayerGR10, "BayerGR10", 2, 10, kGR, PixelFormat::kBayerGR8},
    {PixelFormat::kBayerRG10, "BayerRG10", 2, 10, kRG, PixelFormat::kBayerRG8},
    {PixelFormat::kBayerGB10, "BayerGB10", 2, 10, kGB, PixelFormat::kBayerGB8},
    {PixelFormat::kBayerBG10, "BayerBG10", 2, 10, kBG, PixelFormat::kBayerBG8},
    {PixelFormat::kBayerGR12, "BayerGR12", 2, 12, kGR, PixelFormat::kBayerGR8},
    {PixelFormat::kBayerRG12, "BayerRG12", 2, 12, kRG, PixelFormat::kBayerRG8},
    {PixelFormat::kBayerGB12, "BayerGB12", 2, 12, kGB, PixelFormat::kBayerGB8},
    {PixelFormat::kBayerBG12, "BayerBG12", 2, 12, kBG, PixelFormat::kBayerBG8},
}};

const FormatInfo& info_of(PixelFormat format) {
  const auto* found = std::find_if(kFormats.begin(), kFormats.end(),
                                   [&](const FormatInfo& f) { return f.format == format; });
  V3D_CHECK(found != kFormats.end());
  return *found;
}

template <class Predicate>
std::optional<PixelFormat> find_format(Predicate predicate) {
  const auto* found = std::find_if(kFormats.begin(), kFormats.end(), predicate);
  return found == kFormats.end() ? std::nullopt : std::optional(found->format);
}

}  // namespace

int bytes_per_pixel(PixelFormat format) { return info_of(format).bytes_per_pixel; }
bool is_bayer(PixelFormat format) { return info_of(format).tile[0] >= 0; }
std::string_view name(PixelFormat format) { return info_of(format).pfnc_name; }
int bits_per_sample(PixelFormat format) { return info_of(format).bits_per_sample; }
PixelFormat reduced_to_8_bits(PixelFormat format) { return info_of(format).reduced; }

std::optional<PixelFormat> pixel_format_from_name(std::string_view pfnc_name) {
  return find_format([&](const FormatInfo& f) { return f.pfnc_name == pfnc_name; });
}

std::optional<PixelFormat> pixel_format_from_code(uint32_t pfnc_code) {
  return find_format(
      [&](const FormatInfo& f) { return static_cast<uint32_t>(f.format) == pfnc_code; });
}

int bayer_channel(PixelFormat format, int x, int y) {
  return info_of(format).tile[(y & 1) * 2 + (x & 1)];
}

Image::Image(ImageSize image_size, PixelFormat pixel_format)
    : size(image_size), format(pixel_format), bytes(byte_count(image_size, pixel_format)) {}

size_t byte_count(ImageSize size, PixelFormat format) {
  return static_cast<size_t>(size.pixels()) * bytes_per_pixel(format);
}

void reduce_to_8_bits(Image& image) {
  if (!is_deep(image.format)) return;
  const int shift = bits_per_sample(image.format) - 8;
  const size_t samples = image.bytes.size() / 2;
  for (size_t i = 0; i < samples; ++i) {
    const int sample = image.bytes[2 * i] | image.bytes[2 * i + 1] << 8;
    image.bytes[i] = static_cast<uint8_t>(std::min(sample >> shift, 255));
  }
  image.bytes.resize(samples);
  image.format = reduced_to_8_bits(image.format);
}

Image crop(ImageView source, Rect rect) {
  V3D_CHECK(rect.x0 >= 0 && rect.y0 >= 0 && rect.x0 + rect.width <= source.size.width &&
            rect.y0 + rect.height <= source.size.height);
  V3D_CHECK(!is_bayer(source.format) || (rect.x0 % 2 == 0 && rect.y0 % 2 == 0));
  if (rect.empty()) {
    return {ImageSize{0, 0}, source.format};
  }
  Image part({rect.width, rect.height}, source.format);
  const size_t pixel = bytes_per_pixel(source.format);
  for (int y = 0; y < rect.height; ++y) {
    std::memcpy(part.row(y), source.row(rect.y0 + y) + rect.x0 * pixel, rect.width * pixel);
  }
  return part;
}

namespace {

constexpr int kMinSide = 16;

/// Parses an integer at the start of `text` and removes it. False when there is none.
bool consume_number(std::string_view& text, int& value) {
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  text.remove_prefix(static_cast<size_t>(end - text.data()));
  return error == std::errc{};
}

bool is_side(int pixels, Sides sides) {
  return pixels >= kMinSide && pixels <= kMaxImageSide && (sides == Sides::kAny || pixels % 2 == 0);
}

}  // namespace

ImageSize parse_size(std::string_view text, Sides sides, std::string_view option) {
  std::string_view rest = text;
  ImageSize size;
  bool good = consume_number(rest, size.width) && rest.starts_with('x');
  if (good) rest.remove_prefix(1);
  good = good && consume_number(rest, size.height) && rest.empty() && is_side(size.width, sides) &&
         is_side(size.height, sides);
  if (good) return size;
  throw InputError(std::string(option) + " " + std::string(text) + ": expected WIDTHxHEIGHT, " +
                   (sides == Sides::kEven ? "even " : "") + "numbers of pixels from " +
                   std::to_string(kMinSide) + " to " + std::to_string(kMaxImageSide) +
                   ", like 1024x768");
}

std::string format_size(ImageSize size) {
  return std::to_string(size.width) + "x" + std::to_string(size.height);
}

}  // namespace v3d
