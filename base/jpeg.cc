#include "base/jpeg.h"

#include <turbojpeg.h>

#include <cassert>
#include <memory>
#include <stdexcept>

namespace v3d {
namespace {

using Handle = std::unique_ptr<void, decltype(&tjDestroy)>;

}  // namespace

std::vector<uint8_t> encode_jpeg(ImageView rgb, int quality) {
  assert(rgb.format == PixelFormat::kRGB8 && rgb.size.pixels() > 0);
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

std::optional<Image> decode_jpeg(std::span<const uint8_t> jpeg, ImageSize size) {
  const Handle decoder(tjInitDecompress(), tjDestroy);
  ImageSize found;
  int sampling = 0;
  int colours = 0;
  const bool known = tjDecompressHeader3(decoder.get(), jpeg.data(), jpeg.size(), &found.width,
                                         &found.height, &sampling, &colours) == 0;
  if (!known || found != size) return std::nullopt;
  Image image(size, PixelFormat::kRGB8);
  // A progressive picture may ask for a thousand passes over it: TJFLAG_LIMITSCANS.
  const int failed =
      tjDecompress2(decoder.get(), jpeg.data(), jpeg.size(), image.bytes.data(), size.width, 0,
                    size.height, TJPF_RGB, TJFLAG_STOPONWARNING | TJFLAG_LIMITSCANS);
  if (failed != 0) return std::nullopt;
  return image;
}

}  // namespace v3d
