#include "base/image/png_file.h"

#include <spng.h>

#include <cstdlib>
#include <memory>
#include <new>

#include "base/core/check.h"
#include "base/core/error.h"
#include "base/image/demosaic.h"
#include "base/io/whole_file.h"

namespace v3d {
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
std::string encode(ImageSize size, int channels, int bits, const void* samples, size_t bytes) {
  V3D_CHECK(channels == 1 || channels == 3);
  const Context context = make_context(SPNG_CTX_ENCODER);
  spng_set_option(context.get(), SPNG_ENCODE_TO_BUFFER, 1);
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

void write_png(const std::filesystem::path& path, ImageView image) {
  const Image rgb = to_rgb(image);
  replace_file(path, encode(rgb.size, 3, 8, rgb.bytes.data(), rgb.bytes.size()));
}

}  // namespace v3d
