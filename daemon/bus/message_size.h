// Sizes of messages. A sender shortens what its receivers would drop.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>

#include "daemon/bus/channel_list.h"
#include "daemon/bus/datagram.h"

namespace v3d::bus {

/// The longest health, in bytes, that receivers accept without verification: a stranger determines
/// how much memory it needs.
inline constexpr size_t kMaxUnverifiedHealth = size_t{32} << 10;

/// Whether the message of this first datagram is delivered although it is not authentic.
bool is_shown_unverified(const Datagram& first, const ChannelKind& kind);

/// The longest encoded message, in bytes, that receivers accept on `channel`: its limit without
/// trailer and signature. `has_key`: the sender has the studio key. Without it, receivers cannot
/// verify the message. kMaxMessage for a name that is no channel of a studio.
size_t max_encoded_bytes(std::string_view channel, bool has_key);

/// `text`, or its beginning with " ..." at the end, at most `max_bytes` long. Cuts between two
/// characters of UTF-8. `max_bytes` is at least 4.
std::string shortened(const std::string& text, size_t max_bytes);

}  // namespace v3d::bus
