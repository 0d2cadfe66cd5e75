// Reassembly of fragmented messages in memory that is allocated once. Pure.
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

/// Which message a fragment belongs to. Fragments agree in all of it.
struct MessageIdentity {
  uint64_t sender = 0;  ///< a session, or the source address where nothing is verified
  uint32_t sequence = 0;
  int64_t sent_ns = 0;  ///< of the trailer; 0 without one
  uint32_t size = 0;    ///< of the message without its trailer, bytes
  uint16_t count = 0;   ///< of fragments
  friend bool operator==(const MessageIdentity&, const MessageIdentity&) = default;
};

struct MessageFragment {
  MessageIdentity of;
  uint16_t number = 0;
  uint32_t offset = 0;         ///< of `data`; offset + data.size() <= of.size
  std::string_view channel{};  ///< of fragment 0
  std::span<const uint8_t> data{};
};

/// Messages come together in a ring of kBytes, in the order of their first fragments that arrived,
/// at most kSlots at a time. A message that is incomplete when the ring comes round to its place,
/// or when all slots are in use, is given up: so much newer data has arrived meanwhile. Fragments
/// may come in any order and repeatedly. One thread.
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
  /// The message when this was its last missing fragment; valid until the next call. Precondition:
  /// of.size <= kMaxMessage, 1 < of.count <= kMaxFragments, number < count, data in bounds.
  std::optional<Message> add(const MessageFragment& fragment);
  /// What has arrived of it is no longer needed.
  void drop(const MessageIdentity& message);

  int64_t given_up() const { return given_up_; }
  /// Messages whose fragments overlapped, or left gaps.
  int64_t inconsistent() const { return inconsistent_; }

 private:
  struct Slot {
    MessageIdentity message;
    bool is_open = false;
    size_t begin = 0;  ///< in the ring
    std::array<char, kMaxChannelName> channel{};
    size_t channel_size = 0;
    size_t missing = 0;  ///< fragments
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

  const std::unique_ptr<uint8_t[]> bytes_;  ///< the kernel gives pages as they are written
  std::vector<Slot> slots_;                 ///< a queue, oldest first: used_ from first_ on
  size_t first_ = 0;
  size_t used_ = 0;
  size_t next_ = 0;  ///< where the next message begins
  int64_t given_up_ = 0;
  int64_t inconsistent_ = 0;
};

}  // namespace v3d
