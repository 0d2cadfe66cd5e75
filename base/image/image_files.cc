#include "base/image/image_files.h"

#include <spng.h>
#include <turbojpeg.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <memory>
#include <new>
#include <stdexcept>

#include "base/core/error.h"
#include "base/image/colour.h"
#include "base/io/file.h"

namespace v3d {
namespace {

using Handle = std::unique_ptr<void, decltype(&tjDestroy)>;

std::optional<ImageSize> size_of(tjhandle decoder, std::span<const uint8_t> jpeg) {
  ImageSize size;
  int sampling = 0;
  int colours = 0;
  if (tjDecompressHeader3(decoder, jpeg.data(), jpeg.size(), &size.width, &size.height, &sampling,
                          &colours) != 0) {
    return std::nullopt;
  }
  return size;
}

}  // namespace

std::vector<uint8_t> encode_jpeg(ImageView rgb, int quality) {
  V3D_CHECK(rgb.format == PixelFormat::kRGB8 && rgb.size.pixels() > 0);
  const Handle jpeg(tjInitCompress(), tjDestroy);
  unsigned long size = tjBufSize(rgb.size.width, rgb.size.height, TJSAMP_420);
  std::vector<uint8_t> bytes(size);
  uint8_t* begin = bytes.data();
  const int failed = tjCompress2(jpeg.get(), rgb.bytes.data(), rgb.size.width, 0, rgb.size.height,
                                 TJPF_RGB, &begin, &size, TJSAMP_420, quality, TJFLAG_NOREALLOC);
  if (failed != 0) throw std::runtime_error(tjGetErrorStr2(jpeg.get()));
  bytes.resize(size);
  return bytes;
}

std::optional<ImageSize> jpeg_size(std::span<const uint8_t> jpeg) {
  const Handle decoder(tjInitDecompress(), tjDestroy);
  const auto size = size_of(decoder.get(), jpeg);
  if (!size || size->width > kMaxImageSide || size->height > kMaxImageSide) return std::nullopt;
  return size;
}

std::optional<Image> decode_jpeg(std::span<const uint8_t> jpeg, ImageSize size) {
  const Handle decoder(tjInitDecompress(), tjDestroy);
  if (size_of(decoder.get(), jpeg) != size) return std::nullopt;
  Image image(size, PixelFormat::kRGB8);
  // TJFLAG_LIMITSCANS: a progressive image can require a thousand passes.
  const int failed =
      tjDecompress2(decoder.get(), jpeg.data(), jpeg.size(), image.bytes.data(), size.width, 0,
                    size.height, TJPF_RGB, TJFLAG_STOPONWARNING | TJFLAG_LIMITSCANS);
  if (failed != 0) return std::nullopt;
  return image;
}

namespace {

/// Largest expansion of zlib. The decoders reject a header that promises more bytes, before they
/// allocate memory.
constexpr size_t kMaxExpansion = 1032;

struct FreeContext {
  void operator()(spng_ctx* context) const { spng_ctx_free(context); }
};
using Context = std::unique_ptr<spng_ctx, FreeContext>;

Context make_context(int flags) {
  Context context(spng_ctx_new(flags));
  if (!context) throw std::bad_alloc();
  return context;
}

/// `samples` are in native byte order.
std::string encode(ImageSize size, int channels, int bits, const void* samples, size_t bytes,
                   PngEffort effort = PngEffort::kNormal) {
  V3D_CHECK(channels == 1 || channels == 3);
  const Context context = make_context(SPNG_CTX_ENCODER);
  spng_set_option(context.get(), SPNG_ENCODE_TO_BUFFER, 1);
  if (effort == PngEffort::kFast) spng_set_option(context.get(), SPNG_IMG_COMPRESSION_LEVEL, 1);
  spng_ihdr header{};
  header.width = static_cast<uint32_t>(size.width);
  header.height = static_cast<uint32_t>(size.height);
  header.bit_depth = static_cast<uint8_t>(bits);
  header.color_type = channels == 3 ? SPNG_COLOR_TYPE_TRUECOLOR : SPNG_COLOR_TYPE_GRAYSCALE;
  int error = spng_set_ihdr(context.get(), &header);
  if (error == 0) {
    error = spng_encode_image(context.get(), samples, bytes, SPNG_FMT_PNG, SPNG_ENCODE_FINALIZE);
  }
  size_t length = 0;
  void* const png = error == 0 ? spng_get_png_buffer(context.get(), &length, &error) : nullptr;
  const std::unique_ptr<void, decltype(&std::free)> owner(png, &std::free);
  if (error != 0) throw std::runtime_error(std::string("PNG: ") + spng_strerror(error));
  return {static_cast<const char*>(png), length};
}

[[noreturn]] void reject(const std::filesystem::path& path, const std::string& what) {
  throw InputError(path.string() + ": " + what);
}

}  // namespace

std::string encode_png(const DeepImage& image) {
  return encode(image.size, image.channels, 16, image.samples.data(),
                image.samples.size() * sizeof(uint16_t));
}

DeepImage decode_png(std::string_view bytes, const std::filesystem::path& path) {
  const Context context = make_context(0);
  spng_set_image_limits(context.get(), kMaxImageSide, kMaxImageSide);
  spng_ihdr header{};
  if (spng_set_png_buffer(context.get(), bytes.data(), bytes.size()) != 0 ||
      spng_get_ihdr(context.get(), &header) != 0) {
    reject(path, "not a valid PNG image");
  }
  const bool rgb = header.color_type == SPNG_COLOR_TYPE_TRUECOLOR;
  if (header.bit_depth != 16 || !(rgb || header.color_type == SPNG_COLOR_TYPE_GRAYSCALE)) {
    reject(path, "expected a PNG image of 16 bits, grey or RGB");
  }
  DeepImage image{
      {static_cast<int>(header.width), static_cast<int>(header.height)}, rgb ? 3 : 1, {}};
  const size_t samples = static_cast<size_t>(image.size.pixels()) * image.channels;
  if (samples * sizeof(uint16_t) > kMaxExpansion * bytes.size()) {
    reject(path, "not a valid PNG image");
  }
  image.samples.resize(samples);
  if (spng_decode_image(context.get(), image.samples.data(),
                        image.samples.size() * sizeof(uint16_t), SPNG_FMT_PNG, 0) != 0) {
    reject(path, "not a valid PNG image");
  }
  return image;
}

Image decode_rgb_png(std::string_view bytes, const std::filesystem::path& path) {
  const Context context = make_context(0);
  spng_set_image_limits(context.get(), kMaxImageSide, kMaxImageSide);
  spng_ihdr header{};
  size_t size = 0;
  const bool known = spng_set_png_buffer(context.get(), bytes.data(), bytes.size()) == 0 &&
                     spng_get_ihdr(context.get(), &header) == 0 &&
                     spng_decoded_image_size(context.get(), SPNG_FMT_RGB8, &size) == 0 &&
                     static_cast<size_t>(header.width) * header.height * header.bit_depth / 8 <=
                         kMaxExpansion * bytes.size();
  if (!known) reject(path, "not a valid PNG image");
  Image image({static_cast<int>(header.width), static_cast<int>(header.height)},
              PixelFormat::kRGB8);
  if (size != image.bytes.size() ||
      spng_decode_image(context.get(), image.bytes.data(), size, SPNG_FMT_RGB8, 0) != 0) {
    reject(path, "not a valid PNG image");
  }
  return image;
}

void write_png(const std::filesystem::path& path, ImageView image, PngEffort effort) {
  const bool grey = image.format == PixelFormat::kMono8;
  const Image rgb = grey ? Image() : to_rgb(image);
  const std::span<const uint8_t> samples = grey ? image.bytes : std::span(rgb.bytes);
  replace_file(path, encode(image.size, grey ? 1 : 3, 8, samples.data(), samples.size(), effort));
}

Image read_picture(const std::filesystem::path& path) {
  return decode_picture(read_file(path), path);
}

Image decode_picture(std::string_view bytes, const std::filesystem::path& path) {
  if (bytes.starts_with("\x89PNG")) return decode_rgb_png(bytes, path);
  const std::span<const uint8_t> jpeg{reinterpret_cast<const uint8_t*>(bytes.data()), bytes.size()};
  if (const auto size = jpeg_size(jpeg)) {
    if (auto image = decode_jpeg(jpeg, *size)) return std::move(*image);
  }
  throw InputError(path.string() + ": not a valid PNG or JPEG picture");
}

Mask mask_from_picture(const Image& picture) {
  Mask mask(picture.size);
  for (int y = 0; y < picture.size.height; ++y) {
    const uint8_t* rgb = picture.row(y);
    for (int x = 0; x < picture.size.width; ++x, rgb += 3) {
      if (rgb[0] + rgb[1] + rgb[2] >= 3 * 128) mask.set(x, y);
    }
  }
  return mask;
}

Image fill_size(const Image& picture, ImageSize size) {
  Image filled(size, PixelFormat::kRGB8);
  const double scale = std::max(static_cast<double>(size.width) / picture.size.width,
                                static_cast<double>(size.height) / picture.size.height);
  const auto source = [&](int n, int to, int from) {
    const double at = (n + 0.5 - 0.5 * to) / scale + 0.5 * from - 0.5;
    return std::clamp(at, 0.0, from - 1.0);
  };
  for (int y = 0; y < size.height; ++y) {
    for (int x = 0; x < size.width; ++x) {
      sample_picture(picture, source(x, size.width, picture.size.width),
                     source(y, size.height, picture.size.height), filled.row(y) + 3 * x);
    }
  }
  return filled;
}

Image reduced(const Image& picture, int factor) {
  const int n = factor;
  Image small({picture.size.width / n, picture.size.height / n}, PixelFormat::kRGB8);
  V3D_CHECK(small.size.pixels() > 0 && picture.format == PixelFormat::kRGB8);
  for (int y = 0; y < small.size.height; ++y) {
    for (int x = 0; x < 3 * small.size.width; ++x) {
      const int column = 3 * (x / 3) * n + x % 3;
      int sum = n * n / 2;
      for (int dy = 0; dy < n; ++dy) {
        for (int dx = 0; dx < n; ++dx) sum += picture.row(y * n + dy)[column + 3 * dx];
      }
      small.row(y)[x] = static_cast<uint8_t>(sum / (n * n));
    }
  }
  return small;
}

void sample_picture(const Image& picture, double x, double y, uint8_t rgb[3]) {
  const auto [width, height] = picture.size;
  const double left = std::floor(x), above = std::floor(y);
  const double s = x - left, t = y - above;
  const auto column = [w = width](double at) {
    const int n = static_cast<int>(std::fmod(at, w));
    return 3 * (n < 0 ? n + w : n);
  };
  const auto row = [&, h = height](double at) {
    return picture.row(static_cast<int>(std::clamp(at, 0.0, h - 1.0)));
  };
  const uint8_t* upper = row(above);
  const uint8_t* lower = row(above + 1);
  const int i = column(left), j = column(left + 1);
  for (int c = 0; c < 3; ++c) {
    const double high = (1 - s) * upper[i + c] + s * upper[j + c];
    const double low = (1 - s) * lower[i + c] + s * lower[j + c];
    rgb[c] = static_cast<uint8_t>((1 - t) * high + t * low + 0.5);
  }
}

}  // namespace v3d
