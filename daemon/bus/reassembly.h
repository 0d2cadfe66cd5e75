// Reassembly of fragmented messages in memory that is allocated once. Uses no socket and no clock.
#pragma once

#include <array>
#include <bitset>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include "daemon/bus/datagram.h"

namespace v3d {

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

}  // namespace v3d
