#include "v3d/preview_t.hpp"
#include "wire/codec.h"
#include "wire/packing.h"

namespace v3d {
namespace {

constexpr Layout kPreviewLayout = "qqsqii?nnB0B1";

}  // namespace

Bytes encode(const PreviewMessage& m) {
  preview_t w;
  w.utime = utime_of(m.sent);
  w.seq = m.seq;
  w.camera = m.camera;
  w.pulse = m.pulse;
  w.width = m.size.width;
  w.height = m.size.height;
  w.has_mask = m.mask.has_value();
  if (m.mask) w.runs = encode_runs(*m.mask);
  w.n_runs = static_cast<int32_t>(w.runs.size());
  w.jpeg = m.jpeg;
  w.n_jpeg = static_cast<int32_t>(w.jpeg.size());
  return pack(w);
}

template <>
std::optional<PreviewMessage> decode(std::span<const uint8_t> bytes) {
  auto w = unpack<preview_t>(kPreviewLayout, bytes);
  if (!w) return std::nullopt;
  const auto sent = instant_of(w->utime);
  const auto is_small = [](int32_t side) { return side >= 1 && side <= kMaxPreviewSide; };
  if (!sent || w->seq < 0 || w->pulse < -1 || !is_small(w->width) || !is_small(w->height)) {
    return std::nullopt;
  }
  PreviewMessage m{.sent = *sent,
                   .seq = w->seq,
                   .camera = w->camera,
                   .pulse = w->pulse,
                   .size = {w->width, w->height},
                   .mask = {},
                   .jpeg = std::move(w->jpeg)};
  if (w->has_mask) m.mask = decode_runs(w->runs, m.size);
  const bool mask_ok = w->has_mask ? m.mask.has_value() : w->n_runs == 0;
  if (!mask_ok) return std::nullopt;
  return m;
}

}  // namespace v3d
