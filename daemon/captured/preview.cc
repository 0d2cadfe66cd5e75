#include "daemon/captured/preview.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "base/core/error.h"
#include "base/image/image_files.h"
#include "wire/messages.h"

namespace v3d::captured {
namespace {

/// JPEG quality. A preview of 512x384 has about 20 kB; 15 of them per second use about a thousandth
/// of the network.
constexpr int kQuality = 75;

}  // namespace

PreviewSender::PreviewSender(bus::Bus& bus, std::string camera, double rate_hz)
    : bus_(bus),
      camera_(std::move(camera)),
      every_(std::max<int64_t>(1, static_cast<int64_t>(std::lround(rate_hz)))) {}

void PreviewSender::send(int64_t pulse, ImageView raw, const Mask* mask) {
  if (raw.size.width < 2 || raw.size.height < 2) return;
  const Image small = preview_of(raw);
  if (small.size.width > wire::kMaxPreviewSide || small.size.height > wire::kMaxPreviewSide) return;
  wire::PreviewMessage message{.sent = Realtime::now(),
                               .seq = seq_++,
                               .camera = camera_,
                               .pulse = pulse,
                               .size = small.size,
                               .mask = {},
                               .jpeg = encode_jpeg(small.view(), kQuality)};
  if (mask != nullptr) message.mask = preview_mask(*mask);
  bus_.publish_authenticated(wire::preview_channel(camera_), encode(message));
}

namespace {

/// The colour channels of the four samples of a quad, row by row. A grey image has 1 everywhere.
struct QuadColours {
  std::array<int, 4> channel{1, 1, 1, 1};
  bool grey = true;
};

QuadColours colours_of(PixelFormat format) {
  if (!is_bayer(format)) return {};
  return {.channel = {bayer_channel(format, 0, 0), bayer_channel(format, 1, 0),
                      bayer_channel(format, 0, 1), bayer_channel(format, 1, 1)},
          .grey = false};
}

void put_mosaic_quad(const QuadColours& colours, const uint8_t* upper, const uint8_t* lower,
                     uint8_t* rgb) {
  const std::array<int, 4> samples = {upper[0], upper[1], lower[0], lower[1]};
  std::array<int, 3> sum{};
  std::array<int, 3> count{};
  for (size_t i = 0; i < 4; ++i) {
    sum[static_cast<size_t>(colours.channel[i])] += samples[i];
    ++count[static_cast<size_t>(colours.channel[i])];
  }
  for (size_t c = 0; c < 3; ++c) {
    const size_t from = colours.grey ? 1 : c;
    rgb[c] = static_cast<uint8_t>(sum[from] / count[from]);
  }
}

void put_rgb_quad(const uint8_t* upper, const uint8_t* lower, uint8_t* rgb) {
  for (int c = 0; c < 3; ++c) {
    rgb[c] = static_cast<uint8_t>((upper[c] + upper[c + 3] + lower[c] + lower[c + 3]) / 4);
  }
}

}  // namespace

Image preview_of(ImageView raw) {
  const ImageSize half{raw.size.width / 2, raw.size.height / 2};
  V3D_CHECK(half.pixels() > 0);
  Image small(half, PixelFormat::kRGB8);
  const QuadColours colours = colours_of(raw.format);
  for (int y = 0; y < half.height; ++y) {
    const uint8_t* upper = raw.row(2 * y);
    const uint8_t* lower = raw.row(2 * y + 1);
    uint8_t* rgb = small.row(y);
    for (int x = 0; x < half.width; ++x, rgb += 3) {
      if (raw.format == PixelFormat::kRGB8) {
        put_rgb_quad(upper + 6 * x, lower + 6 * x, rgb);
      } else {
        put_mosaic_quad(colours, upper + 2 * x, lower + 2 * x, rgb);
      }
    }
  }
  return small;
}

Mask preview_mask(const Mask& mask) {
  const ImageSize half{mask.size().width / 2, mask.size().height / 2};
  Mask small(half);
  for (int y = 0; y < half.height; ++y) {
    for (int x = 0; x < half.width; ++x) {
      if (mask.get(2 * x, 2 * y) || mask.get(2 * x + 1, 2 * y) || mask.get(2 * x, 2 * y + 1) ||
          mask.get(2 * x + 1, 2 * y + 1)) {
        small.set(x, y);
      }
    }
  }
  return small;
}

}  // namespace v3d::captured
