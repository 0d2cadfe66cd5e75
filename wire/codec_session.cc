#include "v3d/session_t.hpp"
#include "wire/codec.h"
#include "wire/packing.h"

namespace v3d {
namespace {

constexpr Layout kSessionLayout = "qiiq?";

}  // namespace

Bytes encode(const SessionMessage& m) {
  session_t w;
  w.utime = utime_of(m.sent);
  w.session = static_cast<int32_t>(m.session);
  w.newest = static_cast<int32_t>(m.newest);
  w.nonce = m.nonce;
  w.is_answer = m.is_answer;
  return pack(w);
}

template <>
std::optional<SessionMessage> decode(std::span<const uint8_t> bytes) {
  const auto w = unpack<session_t>(kSessionLayout, bytes);
  if (!w) return std::nullopt;
  const auto sent = instant_of(w->utime);
  if (!sent || w->nonce == 0) return std::nullopt;
  return SessionMessage{.sent = *sent,
                        .session = static_cast<uint32_t>(w->session),
                        .newest = static_cast<uint32_t>(w->newest),
                        .nonce = w->nonce,
                        .is_answer = w->is_answer != 0};
}

}  // namespace v3d
