#include "daemon/bus/message_size.h"

#include <algorithm>
#include <cstdint>

#include "wire/datagram_mac.h"
#include "wire/signatures.h"

namespace v3d::bus {

bool is_shown_unverified(const Datagram& first, const ChannelKind& kind) {
  return first.is_whole() && kind.is_shown_unverified && first.message_size <= kMaxUnverifiedHealth;
}

size_t max_encoded_bytes(std::string_view channel, bool has_key) {
  const ChannelKind* const kind = kind_of(channel);
  const size_t limit = kind == nullptr ? kMaxMessage : kind->max_bytes;
  const bool is_signed = kind != nullptr && kind->is_signed();
  const size_t room = limit - wire::kMacTrailerSize - (is_signed ? wire::kMessageSignatureSize : 0);
  const bool is_unverified = !has_key && kind != nullptr && kind->is_shown_unverified;
  return is_unverified ? std::min(room, kMaxUnverifiedHealth) : room;
}

std::string shortened(const std::string& text, size_t max_bytes) {
  constexpr std::string_view kEnd = " ...";
  if (text.size() <= max_bytes) return text;
  size_t end = max_bytes - kEnd.size();
  const auto continues = [&](size_t i) { return (static_cast<uint8_t>(text[i]) & 0xc0) == 0x80; };
  while (end > 0 && continues(end)) --end;
  return text.substr(0, end) + std::string(kEnd);
}

}  // namespace v3d::bus
