#include "daemon/captured/preview_sender.h"

#include <algorithm>
#include <cmath>

#include "base/image/jpeg.h"
#include "capture/cameras/preview.h"
#include "wire/channels.h"

namespace v3d {
namespace {

/// JPEG quality. A preview of 512x384 has about 20 kB; 15 of them per second use about a thousandth
/// of the network.
constexpr int kQuality = 75;

}  // namespace

PreviewSender::PreviewSender(Bus& bus, std::string camera, double rate_hz)
    : bus_(bus),
      camera_(std::move(camera)),
      every_(std::max<int64_t>(1, static_cast<int64_t>(std::lround(rate_hz)))) {}

void PreviewSender::send(int64_t pulse, ImageView raw, const Mask* mask) {
  const Image small = preview_of(raw);
  if (small.size.width > kMaxPreviewSide || small.size.height > kMaxPreviewSide) return;
  PreviewMessage message{.sent = Realtime::now(),
                         .seq = seq_++,
                         .camera = camera_,
                         .pulse = pulse,
                         .size = small.size,
                         .mask = {},
                         .jpeg = encode_jpeg(small.view(), kQuality)};
  if (mask != nullptr) message.mask = preview_mask(*mask);
  bus_.publish_authenticated(preview_channel(camera_), encode(message));
}

}  // namespace v3d
