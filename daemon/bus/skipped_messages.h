// Set of messages whose remaining fragments are not needed, in memory of fixed size.
#pragma once

#include <array>
#include <cstddef>

#include "daemon/bus/datagram.h"

namespace v3d::bus {

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
