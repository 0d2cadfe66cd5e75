#include "capture/cameras/pixel_decoder.h"

#include <libyuv/convert_argb.h>
#include <libyuv/planar_functions.h>

#include <algorithm>
#include <vector>

#include "base/core/error.h"
#include "base/image/image_files.h"

namespace v3d::capture {
namespace {

int half_up(int n) { return (n + 1) / 2; }

/// Writes samples as little-endian 16-bit words.
class SampleWriter {
 public:
  explicit SampleWriter(uint8_t* to) : to_(to) {}
  void add(uint32_t sample) {
    *to_++ = static_cast<uint8_t>(sample);
    *to_++ = static_cast<uint8_t>(sample >> 8);
  }

 private:
  uint8_t* to_;
};

/// The bit stream starts with the lowest bits of the first byte.
void unpack_lsb(const uint8_t* from, int samples, int bits, SampleWriter to) {
  const uint32_t mask = (1U << bits) - 1;
  uint32_t window = 0;
  int available = 0;
  for (int i = 0; i < samples; ++i) {
    for (; available < bits; available += 8) window |= uint32_t{*from++} << available;
    to.add(window & mask);
    window >>= bits;
    available -= bits;
  }
}

/// The bit stream starts with the highest bits of the first byte.
void unpack_msb(const uint8_t* from, int samples, int bits, SampleWriter to) {
  const uint32_t mask = (1U << bits) - 1;
  uint32_t window = 0;
  int available = 0;
  for (int i = 0; i < samples; ++i) {
    for (; available < bits; available += 8) window = window << 8 | *from++;
    available -= bits;
    to.add(window >> available & mask);
  }
}

void unpack_gige(const uint8_t* from, int samples, int bits, SampleWriter to) {
  const int low_bits = bits - 8;
  const uint32_t mask = (1U << low_bits) - 1;
  for (int i = 0; i < samples; i += 2, from += 3) {
    to.add(uint32_t{from[0]} << low_bits | (from[1] & mask));
    to.add(uint32_t{from[2]} << low_bits | (from[1] >> 4 & mask));
  }
}

void unpack_mipi(const uint8_t* from, int samples, int bits, SampleWriter to) {
  const int low_bits = bits - 8;
  const int group = 8 / low_bits;
  const uint32_t mask = (1U << low_bits) - 1;
  for (int i = 0; i < samples; i += group, from += group + 1) {
    for (int k = 0; k < group; ++k) {
      to.add(uint32_t{from[k]} << low_bits | (from[group] >> k * low_bits & mask));
    }
  }
}

void unpack_row(CameraFormat format, const uint8_t* from, int samples, uint8_t* to) {
  const int bits = bits_per_sample(format.image);
  switch (format.layout) {
    case PixelLayout::kLsbPacked:
      return unpack_lsb(from, samples, bits, SampleWriter(to));
    case PixelLayout::kMsbPacked:
      return unpack_msb(from, samples, bits, SampleWriter(to));
    case PixelLayout::kGigePacked:
      return unpack_gige(from, samples, bits, SampleWriter(to));
    case PixelLayout::kMipi:
      return unpack_mipi(from, samples, bits, SampleWriter(to));
    default:
      V3D_CHECK(false && "a layout without packed samples");
  }
}

/// Rows without their padding.
Image copy_rows(const SentLayout& layout, std::span<const uint8_t> bytes) {
  const size_t row = row_bytes(layout.format, layout.size.width);
  Image image;
  image.size = layout.size;
  image.format = layout.format.image;
  if (layout.stride == row) {
    image.bytes.assign(bytes.begin(),
                       bytes.begin() + static_cast<std::ptrdiff_t>(layout.byte_count()));
    return image;
  }
  image.bytes.reserve(row * layout.size.height);
  for (int y = 0; y < layout.size.height; ++y) {
    const auto from = bytes.begin() + static_cast<std::ptrdiff_t>(y * layout.stride);
    image.bytes.insert(image.bytes.end(), from, from + static_cast<std::ptrdiff_t>(row));
  }
  return image;
}

Image unpack(const SentLayout& layout, std::span<const uint8_t> bytes) {
  Image image(layout.size, layout.format.image);
  for (int y = 0; y < layout.size.height; ++y) {
    unpack_row(layout.format, bytes.data() + y * layout.stride, layout.size.width, image.row(y));
  }
  return image;
}

/// Constants of libyuv for V and U in exchanged order, which make its BGR output RGB.
const libyuv::YuvConstants* constants_of(YuvCoding coding) {
  if (coding.is_bt709) {
    return coding.is_full_range ? &libyuv::kYvuF709Constants : &libyuv::kYvuH709Constants;
  }
  return coding.is_full_range ? &libyuv::kYvuJPEGConstants : &libyuv::kYvuI601Constants;
}

Image from_yuv422(const SentLayout& layout, std::span<const uint8_t> bytes) {
  const auto [width, height] = layout.size;
  const int half = half_up(width);
  const auto stride = static_cast<int>(layout.stride);
  std::vector<uint8_t> y(static_cast<size_t>(layout.size.pixels()));
  std::vector<uint8_t> u(static_cast<size_t>(half) * height);
  std::vector<uint8_t> v(u.size());
  const auto split =
      layout.format.layout == PixelLayout::kYuyv ? libyuv::YUY2ToI422 : libyuv::UYVYToI422;
  split(bytes.data(), stride, y.data(), width, u.data(), half, v.data(), half, width, height);
  Image image(layout.size, PixelFormat::kRGB8);
  libyuv::I422ToRGB24Matrix(y.data(), width, v.data(), half, u.data(), half, image.bytes.data(),
                            3 * width, constants_of(layout.coding), width, height);
  return image;
}

Image from_nv12(const SentLayout& layout, std::span<const uint8_t> bytes) {
  const auto [width, height] = layout.size;
  const auto stride = static_cast<int>(layout.stride);
  const uint8_t* chroma = bytes.data() + layout.stride * height;
  Image image(layout.size, PixelFormat::kRGB8);
  libyuv::NV21ToRGB24Matrix(bytes.data(), stride, chroma, stride, image.bytes.data(), 3 * width,
                            constants_of(layout.coding), width, height);
  return image;
}

}  // namespace

size_t SentLayout::byte_count() const {
  if (format.layout == PixelLayout::kJpeg) return 1;
  const int rows =
      format.layout == PixelLayout::kNv12 ? size.height + half_up(size.height) : size.height;
  return rows == 0 ? 0 : stride * (rows - 1) + row_bytes(format, size.width);
}

std::optional<Image> decode_image(const SentLayout& layout, std::span<const uint8_t> bytes) {
  V3D_CHECK(layout.size.width % width_step(layout.format) == 0);
  if (bytes.size() < layout.byte_count()) return std::nullopt;
  switch (layout.format.layout) {
    case PixelLayout::kPlain:
      return copy_rows(layout, bytes);
    case PixelLayout::kLsbPacked:
    case PixelLayout::kGigePacked:
    case PixelLayout::kMipi:
    case PixelLayout::kMsbPacked:
      return unpack(layout, bytes);
    case PixelLayout::kYuyv:
    case PixelLayout::kUyvy:
      return from_yuv422(layout, bytes);
    case PixelLayout::kNv12:
      return from_nv12(layout, bytes);
    case PixelLayout::kJpeg:
      return decode_jpeg(bytes, layout.size);
  }
  V3D_CHECK(false);
}

}  // namespace v3d::capture
