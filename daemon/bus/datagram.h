// Datagrams of LCM: parsing, splitting, reassembly.
#pragma once

#include <array>
#include <bitset>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include "wire/datagram_mac.h"

namespace v3d::bus {

// LCM's UDP multicast wire format: one message as one or several datagrams. Uses no socket and no
// key, and allocates nothing on the receiving side.
//
// A short message (magic "LC02") is one datagram: magic, sequence number, channel with its NUL,
// data. A long one (magic "LC03") is several: magic, sequence number, message size, offset of this
// fragment's data in the message, fragment number, number of fragments; in the first fragment the
// channel with its NUL follows; then data. Integers are big-endian.
// Source: liblcm 1.3.1, udpm_util.h and lcm_udpm.c.

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
  wire::MacTrailer trailer{};

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
  std::optional<wire::MacTrailer> trailer;
};
DatagramParts split_trailer(const Datagram& datagram);

// Reassembly of fragmented messages in memory that is allocated once. Uses no socket and no clock.

/// Identifies the message of a fragment. All fragments of a message have the same values.
struct MessageIdentity {
  uint64_t sender = 0;  ///< a session, or the source address without authentication
  uint32_t sequence = 0;
  int64_t sent_ns = 0;  ///< time in the trailer, ns; 0 without a trailer
  uint32_t size = 0;    ///< of the message without its trailer, bytes
  uint16_t count = 0;   ///< number of fragments
  friend bool operator==(const MessageIdentity&, const MessageIdentity&) = default;
};

/// A part of a message.
struct MessageFragment {
  MessageIdentity of;
  uint16_t number = 0;
  uint32_t offset = 0;         ///< of `data` in the message, bytes; offset + data.size() <= of.size
  std::string_view channel{};  ///< of fragment 0
  std::span<const uint8_t> data{};
};

/// Reassembles at most kSlots messages at a time in a ring buffer of kBytes, in the order of the
/// first arrived fragments. An incomplete message is discarded when its place in the ring or its
/// slot is needed for a newer message. Fragments may arrive in any order and repeatedly. One
/// thread.
class Reassembly {
 public:
  static constexpr size_t kBytes = size_t{64} << 20;
  static constexpr size_t kSlots = 128;
  static_assert(kBytes >= 2 * kMaxMessage);

  Reassembly();
  Reassembly(const Reassembly&) = delete;
  Reassembly& operator=(const Reassembly&) = delete;

  struct Message {
    std::string_view channel;
    std::span<const uint8_t> bytes;
  };
  /// Returns the message when this was its last missing fragment; valid until the next call.
  /// Precondition: of.size <= kMaxMessage, 1 < of.count <= kMaxFragments, number < count, data in
  /// bounds.
  std::optional<Message> add(const MessageFragment& fragment);
  /// Discards the fragments of a message that is not needed.
  void drop(const MessageIdentity& message);

  /// Number of messages that were discarded incomplete.
  int64_t given_up() const { return given_up_; }
  /// Number of messages whose fragments overlapped or left gaps.
  int64_t inconsistent() const { return inconsistent_; }

 private:
  struct Slot {
    MessageIdentity message;
    bool is_open = false;
    size_t begin = 0;  ///< offset in the ring, bytes
    std::array<char, kMaxChannelName> channel{};
    size_t channel_size = 0;
    size_t missing = 0;  ///< number of fragments
    std::bitset<kMaxFragments> arrived;
    std::array<uint32_t, kMaxFragments> offsets{};
    std::array<uint32_t, kMaxFragments> sizes{};
  };
  Slot* find(const MessageIdentity& message);
  Slot& open(const MessageIdentity& message);
  size_t make_room(size_t size);
  void remove_oldest();
  void put(Slot& slot, const MessageFragment& fragment);
  Slot& slot(size_t age_order) { return slots_[(first_ + age_order) % kSlots]; }
  static bool is_tiled(const Slot& slot);

  const std::unique_ptr<uint8_t[]> bytes_;  ///< the kernel allocates pages when they are written
  std::vector<Slot> slots_;  ///< a circular queue, oldest first: `used_` slots from `first_`
  size_t first_ = 0;
  size_t used_ = 0;
  size_t next_ = 0;  ///< offset of the next message in the ring, bytes
  int64_t given_up_ = 0;
  int64_t inconsistent_ = 0;
};

// Set of messages whose remaining fragments are not needed, in memory of fixed size.

/// Remembers the last messages without a subscription. A new message may replace an older one; the
/// fragments of that one are then verified and dropped later. One thread.
class SkippedMessages {
 public:
  bool contains(const MessageIdentity& message) const {
    return messages_[place_of(message)] == message;
  }
  void insert(const MessageIdentity& message) { messages_[place_of(message)] = message; }

 private:
  static size_t place_of(const MessageIdentity& message) {
    return (message.sender ^ message.sequence) % kPlaces;
  }

  static constexpr size_t kPlaces = 256;
  std::array<MessageIdentity, kPlaces> messages_{};
};

}  // namespace v3d::bus
