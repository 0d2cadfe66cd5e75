#include "base/image/jpeg.h"

#include <turbojpeg.h>

#include <memory>
#include <stdexcept>

#include "base/core/check.h"

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

}  // namespace v3d
