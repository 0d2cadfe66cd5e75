#include "v3d/pulse_t.hpp"
#include "wire/codec.h"
#include "wire/packing.h"

namespace v3d {
namespace {

constexpr Layout kPulseLayout = "qqsqqq";

}  // namespace

Bytes encode(const PulseMessage& m) {
  pulse_t w;
  w.utime = utime_of(m.sent);
  w.seq = m.seq;
  w.take = m.take;
  w.pulse = m.pulse;
  w.t_edge_ns = to_ns(m.edge);
  w.t_edge_monotonic_ns = to_ns(m.edge_monotonic);
  return pack(w);
}

template <>
std::optional<PulseMessage> decode(std::span<const uint8_t> bytes) {
  const auto w = unpack<pulse_t>(kPulseLayout, bytes);
  if (!w) return std::nullopt;
  const auto sent = instant_of(w->utime);
  if (!sent || w->seq < 0 || w->pulse < 0) return std::nullopt;
  return PulseMessage{.sent = *sent,
                      .seq = w->seq,
                      .take = w->take,
                      .pulse = w->pulse,
                      .edge = from_ns<Realtime>(w->t_edge_ns),
                      .edge_monotonic = from_ns<Monotonic>(w->t_edge_monotonic_ns)};
}

}  // namespace v3d
