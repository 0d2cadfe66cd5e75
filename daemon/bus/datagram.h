// LCM's UDP multicast wire format: one message as one or several datagrams. Uses no socket and no
// key, and allocates nothing on the receiving side.
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

/// The longest channel name that LCM permits, in bytes, without its NUL.
inline constexpr size_t kMaxChannelName = 63;
/// The longest UDP payload of IPv4, in bytes.
inline constexpr size_t kMaxDatagram = 65'507;
/// The longest message that is read or sent, with its trailer, in bytes. liblcm's receivers
/// reassemble no longer ones.
inline constexpr size_t kMaxMessage = size_t{16} << 20;
/// The largest number of fragments of a message. liblcm makes 257 of kMaxMessage, lcm-java 263.
inline constexpr size_t kMaxFragments = 512;

/// A parsed datagram, with views into its bytes. All numbers are consistent with each other.
struct Datagram {
  uint32_t sequence = 0;            ///< number of the message, assigned by its sender
  std::string_view channel{};       ///< of fragment 0; empty in the others
  uint32_t message_size = 0;        ///< of the message with a trailer if there is one, bytes
  uint32_t offset = 0;              ///< of `data` in the message, bytes
  uint16_t number = 0;              ///< of this fragment, from 0
  uint16_t count = 1;               ///< number of fragments of the message
  std::span<const uint8_t> head{};  ///< header and channel with its NUL
  std::span<const uint8_t> data{};  ///< the bytes after `head`, with the trailer if there is one

  bool is_whole() const { return count == 1; }
};

/// Parses and checks a datagram. Allocates nothing.
///
/// Empty when `bytes` are not a consistent datagram of LCM: the magic is wrong, the datagram is
/// cut, or the channel is empty or has no NUL within 64 bytes. Also empty when a fragment number is
/// not below the count, data ends beyond the message, or the message or count exceeds the limits
/// above. Also empty when a message of that size needs more fragments.
std::optional<Datagram> parse_datagram(std::span<const uint8_t> bytes);

/// One datagram to be sent: `head`, `data` and, when the message is authenticated, `trailer`.
struct OutgoingDatagram {
  static constexpr size_t kMaxHead = 20 + kMaxChannelName + 1;
  std::array<uint8_t, kMaxHead> head_bytes{};
  size_t head_size = 0;
  std::span<const uint8_t> data{};  ///< view into the message
  MacTrailer trailer{};

  std::span<const uint8_t> head() const { return std::span(head_bytes).first(head_size); }
};

/// Splits a message into datagrams. Empty when the channel's name or the message is too long.
///
/// With `with_trailer`, each datagram has room for a trailer. The sizes in the headers make liblcm
/// reassemble the data of all fragments plus the last trailer: liblcm overwrites the trailer of
/// every other fragment with the data of the next one.
std::vector<OutgoingDatagram> split_message(uint32_t sequence, std::string_view channel,
                                            std::span<const uint8_t> message, bool with_trailer);

/// The message's data in this datagram, and its trailer; the latter is empty when the last 32 bytes
/// of the data are not a trailer.
struct DatagramParts {
  std::span<const uint8_t> data;
  std::optional<MacTrailer> trailer;
};
DatagramParts split_trailer(const Datagram& datagram);

}  // namespace v3d
