// Makes authentic datagrams without a network, for tests of receivers.
#pragma once

#include <span>
#include <string_view>
#include <vector>

#include "daemon/bus/datagram.h"
#include "daemon/bus/session_replay_filter.h"
#include "support/raw_datagrams.h"
#include "wire/signatures.h"

namespace v3d::test {

inline constexpr RealtimeInstant kNow = from_ns<Realtime>(1'700'000'000'000'000'000);
inline constexpr bus::ReceiverTime kReceiverNow{from_ns<Monotonic>(3'600'000'000'000), kNow};

/// The datagrams of a message, each with a MAC.
inline std::vector<RawDatagram> datagrams_of(const wire::DatagramMac& mac,
                                             const wire::MessageOrigin& origin,
                                             std::span<const uint8_t> message) {
  std::vector<RawDatagram> all;
  for (bus::OutgoingDatagram& datagram :
       bus::split_message(origin.sequence, origin.channel, message, true)) {
    datagram.trailer.session = origin.session;
    datagram.trailer.sent = origin.sent;
    mac.sign(datagram.head(), datagram.data, datagram.trailer);
    RawDatagram bytes(datagram.head().begin(), datagram.head().end());
    bytes.insert(bytes.end(), datagram.data.begin(), datagram.data.end());
    const auto trailer = datagram.trailer.bytes();
    bytes.insert(bytes.end(), trailer.begin(), trailer.end());
    all.push_back(std::move(bytes));
  }
  return all;
}

/// Makes the same datagrams as MulticastSender.
class DatagramSender {
 public:
  explicit DatagramSender(const wire::StudioKey& key) : mac_(key) {}

  /// The datagrams of the next message of the session, each with a MAC.
  std::vector<RawDatagram> datagrams(std::string_view channel, std::span<const uint8_t> message,
                                     RealtimeInstant sent = kNow) {
    const wire::MessageOrigin of = origin(channel, sent);
    ++sequence;
    return datagrams_of(mac_, of, message);
  }

  /// The origin of the next message.
  wire::MessageOrigin origin(std::string_view channel, RealtimeInstant sent = kNow) const {
    return {.channel = channel, .session = session, .sequence = sequence, .sent = sent};
  }
  /// Like datagrams(), with a member's signature too.
  std::vector<RawDatagram> signed_datagrams(std::string_view channel,
                                            std::span<const uint8_t> message,
                                            const wire::SigningKey& key,
                                            RealtimeInstant sent = kNow) {
    return datagrams(channel, sign_on_bus(message, origin(channel, sent), key), sent);
  }

  uint32_t session = wire::random_session();
  uint32_t sequence = 0;

 private:
  wire::DatagramMac mac_;
};

}  // namespace v3d::test
