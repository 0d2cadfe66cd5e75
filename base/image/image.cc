#include "base/image/image.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cstring>

#include "base/core/error.h"

namespace v3d {
namespace {

constexpr uint32_t fourcc(char a, char b, char c, char d) {
  return static_cast<uint32_t>(a) | static_cast<uint32_t>(b) << 8 | static_cast<uint32_t>(c) << 16 |
         static_cast<uint32_t>(d) << 24;
}

struct FormatInfo {
  PixelFormat format;
  std::string_view pfnc_name;
  uint32_t v4l2_fourcc;
  int bytes_per_pixel;
  /// Colours of the 2x2 tile, row-major; -1 for formats without a mosaic.
  std::array<int, 4> tile;
};

constexpr std::array<FormatInfo, 6> kFormats = {{
    {PixelFormat::kMono8, "Mono8", fourcc('G', 'R', 'E', 'Y'), 1, {-1, -1, -1, -1}},
    {PixelFormat::kBayerGR8, "BayerGR8", fourcc('G', 'R', 'B', 'G'), 1, {1, 0, 2, 1}},
    {PixelFormat::kBayerRG8, "BayerRG8", fourcc('R', 'G', 'G', 'B'), 1, {0, 1, 1, 2}},
    {PixelFormat::kBayerGB8, "BayerGB8", fourcc('G', 'B', 'R', 'G'), 1, {1, 2, 0, 1}},
    {PixelFormat::kBayerBG8, "BayerBG8", fourcc('B', 'A', '8', '1'), 1, {2, 1, 1, 0}},
    {PixelFormat::kRGB8, "RGB8", fourcc('R', 'G', 'B', '3'), 3, {-1, -1, -1, -1}},
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
uint32_t v4l2_fourcc(PixelFormat format) { return info_of(format).v4l2_fourcc; }

std::optional<PixelFormat> pixel_format_from_name(std::string_view pfnc_name) {
  return find_format([&](const FormatInfo& f) { return f.pfnc_name == pfnc_name; });
}

std::optional<PixelFormat> pixel_format_from_code(uint32_t pfnc_code) {
  return find_format(
      [&](const FormatInfo& f) { return static_cast<uint32_t>(f.format) == pfnc_code; });
}

std::optional<PixelFormat> pixel_format_from_fourcc(uint32_t v4l2_fourcc) {
  return find_format([&](const FormatInfo& f) { return f.v4l2_fourcc == v4l2_fourcc; });
}

int bayer_channel(PixelFormat format, int x, int y) {
  return info_of(format).tile[(y & 1) * 2 + (x & 1)];
}

Image::Image(ImageSize image_size, PixelFormat pixel_format)
    : size(image_size), format(pixel_format), bytes(byte_count(image_size, pixel_format)) {}

size_t byte_count(ImageSize size, PixelFormat format) {
  return static_cast<size_t>(size.pixels()) * bytes_per_pixel(format);
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
bool take_number(std::string_view& text, int& value) {
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
  bool good = take_number(rest, size.width) && rest.starts_with('x');
  if (good) rest.remove_prefix(1);
  good = good && take_number(rest, size.height) && rest.empty() && is_side(size.width, sides) &&
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
