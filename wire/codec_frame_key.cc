#include <algorithm>

#include "v3d/frame_key_t.hpp"
#include "wire/codec.h"
#include "wire/packing.h"

namespace v3d {
namespace {

constexpr Layout kFrameKeyLayout = "qiinB0";
constexpr size_t kIdSize = std::tuple_size_v<decltype(SealedFrameKey::recipient)>;
constexpr size_t kSealedSize = std::tuple_size_v<decltype(SealedFrameKey::sealed)>;
constexpr size_t kEntrySize = kIdSize + kSealedSize;

}  // namespace

Bytes encode(const FrameKeyMessage& m) {
  frame_key_t w;
  w.utime = utime_of(m.sent);
  w.session = static_cast<int32_t>(m.session);
  w.newest = static_cast<int32_t>(m.newest);
  for (const SealedFrameKey& key : m.keys) {
    w.keys.insert(w.keys.end(), key.recipient.begin(), key.recipient.end());
    w.keys.insert(w.keys.end(), key.sealed.begin(), key.sealed.end());
  }
  w.n_keys = static_cast<int32_t>(w.keys.size());
  return pack(w);
}

template <>
std::optional<FrameKeyMessage> decode(std::span<const uint8_t> bytes) {
  const auto w = unpack<frame_key_t>(kFrameKeyLayout, bytes);
  if (!w) return std::nullopt;
  const auto sent = instant_of(w->utime);
  const size_t size = w->keys.size();
  if (!sent || size % kEntrySize != 0 || size > kMaxFrameKeyRecipients * kEntrySize) {
    return std::nullopt;
  }
  FrameKeyMessage m{.sent = *sent,
                    .session = static_cast<uint32_t>(w->session),
                    .newest = static_cast<uint32_t>(w->newest),
                    .keys = std::vector<SealedFrameKey>(size / kEntrySize)};
  const uint8_t* at = w->keys.data();
  for (SealedFrameKey& key : m.keys) {
    std::copy_n(at, kIdSize, key.recipient.begin());
    std::copy_n(at + kIdSize, kSealedSize, key.sealed.begin());
    at += kEntrySize;
  }
  return m;
}

}  // namespace v3d
