// LCM's UDP multicast wire format: one message as one or several datagrams. Pure: no socket, no
// key, no memory of its own on the receiving side.
//
// A short message (magic "LC02") is one datagram: magic, sequence number, channel with its NUL,
// data. A long one (magic "LC03") is several: magic, sequence number, message size, offset of this
// fragment's data in the message, fragment number, number of fragments; in the first fragment the
// channel with its NUL follows; then data. Integers are big-endian.
// Source: liblcm 1.3.1, udpm_util.h and lcm_udpm.c.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include "wire/datagram_mac.h"

namespace v3d {

/// The longest channel name that LCM knows, in bytes, without its NUL.
inline constexpr size_t kMaxChannelName = 63;
/// The longest datagram that IPv4 carries, in bytes.
inline constexpr size_t kMaxDatagram = 65'507;
/// The longest message that is read or sent, with its trailer, in bytes: what liblcm's receivers
/// can reassemble.
inline constexpr size_t kMaxMessage = size_t{16} << 20;
/// Fragments that a message is read from. liblcm makes 257 of kMaxMessage, lcm-java 263.
inline constexpr size_t kMaxFragments = 512;

/// What a datagram says, as views of its bytes. All numbers are consistent with each other.
struct Datagram {
  uint32_t sequence = 0;            ///< number of the message, counted by its sender
  std::string_view channel{};       ///< of fragment 0; empty in the others
  uint32_t message_size = 0;        ///< bytes of the message, with a trailer if there is one
  uint32_t offset = 0;              ///< of `data` in the message, bytes
  uint16_t number = 0;              ///< of this fragment
  uint16_t count = 1;               ///< fragments of the message
  std::span<const uint8_t> head{};  ///< header and channel with its NUL
  std::span<const uint8_t> data{};  ///< what follows; ends with the trailer if there is one

  bool is_whole() const { return count == 1; }
};

/// Empty when `bytes` are no datagram of LCM's, or one that is not consistent: no magic, cut, a
/// channel without NUL in 64 bytes or without a name, a fragment number that is not below the
/// count, data that would end beyond the message, a message or a count beyond the limits above, or
/// fewer fragments than a message of that size needs. Allocates nothing.
std::optional<Datagram> parse_datagram(std::span<const uint8_t> bytes);

/// One datagram to be sent: `head`, `data` and, where the message is authenticated, `trailer`.
struct OutgoingDatagram {
  static constexpr size_t kMaxHead = 20 + kMaxChannelName + 1;
  std::array<uint8_t, kMaxHead> head_bytes{};
  size_t head_size = 0;
  std::span<const uint8_t> data{};  ///< borrowed from the message
  MacTrailer trailer{};

  std::span<const uint8_t> head() const { return std::span(head_bytes).first(head_size); }
};

/// Cuts a message into datagrams. With `with_trailer`, each leaves room for one, and the sizes in
/// the headers are such that liblcm reassembles data of all fragments in order plus the last
/// trailer: the trailer of every other fragment lies where the data of the next one goes, and is
/// overwritten by it. Empty when the channel's name or the message is too long.
std::vector<OutgoingDatagram> split_message(uint32_t sequence, std::string_view channel,
                                            std::span<const uint8_t> message, bool with_trailer);

/// Whether a message without trailers is longer than one datagram.
bool needs_fragments(std::string_view channel, size_t message_size);

/// The message's data in this datagram, and its trailer: empty when the last 32 bytes of the data
/// are none.
struct DatagramParts {
  std::span<const uint8_t> data;
  std::optional<MacTrailer> trailer;
};
DatagramParts split_trailer(const Datagram& datagram);

}  // namespace v3d
