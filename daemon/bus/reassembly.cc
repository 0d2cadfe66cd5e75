#include "daemon/bus/reassembly.h"

#include <algorithm>
#include <cstring>

#include "base/core/check.h"

namespace v3d {

Reassembly::Reassembly()
    : bytes_(std::make_unique_for_overwrite<uint8_t[]>(kBytes)), slots_(kSlots) {}

std::optional<Reassembly::Message> Reassembly::add(const MessageFragment& fragment) {
  V3D_CHECK(fragment.of.size <= kMaxMessage && fragment.number < fragment.of.count);
  V3D_CHECK(size_t{fragment.offset} + fragment.data.size() <= fragment.of.size);
  Slot* found = find(fragment.of);
  Slot& slot = found != nullptr ? *found : open(fragment.of);
  if (slot.arrived[fragment.number]) return std::nullopt;
  put(slot, fragment);
  if (slot.missing > 0) return std::nullopt;
  slot.is_open = false;
  if (!is_tiled(slot)) {
    ++inconsistent_;
    return std::nullopt;
  }
  return Message{{slot.channel.data(), slot.channel_size},
                 {bytes_.get() + slot.begin, slot.message.size}};
}

void Reassembly::drop(const MessageIdentity& message) {
  Slot* const slot = find(message);
  if (slot != nullptr) slot->is_open = false;
}

Reassembly::Slot* Reassembly::find(const MessageIdentity& message) {
  for (size_t i = used_; i-- > 0;) {  // newest first: the most probable one
    if (slot(i).is_open && slot(i).message == message) return &slot(i);
  }
  return nullptr;
}

Reassembly::Slot& Reassembly::open(const MessageIdentity& message) {
  if (used_ == kSlots) remove_oldest();
  const size_t begin = make_room(message.size);
  Slot& opened = slot(used_++);
  opened.message = message;
  opened.is_open = true;
  opened.begin = begin;
  opened.channel_size = 0;
  opened.missing = message.count;
  opened.arrived.reset();
  return opened;
}

/// Discards the oldest messages until none overlaps the place of the next one. Returns that place.
size_t Reassembly::make_room(size_t size) {
  while (used_ > 0 && !slot(0).is_open) remove_oldest();
  if (used_ == 0) next_ = 0;
  const size_t begin = next_ + size <= kBytes ? next_ : 0;
  const auto overlaps = [&](Slot& other) {
    return other.begin < begin + size && begin < other.begin + other.message.size;
  };
  for (size_t i = 0; i < used_;) {
    if (overlaps(slot(i))) {
      remove_oldest();
      i = 0;
    } else {
      ++i;
    }
  }
  next_ = begin + size;
  return begin;
}

void Reassembly::remove_oldest() {
  if (slot(0).is_open) ++given_up_;
  slot(0).is_open = false;
  first_ = (first_ + 1) % kSlots;
  --used_;
}

void Reassembly::put(Slot& slot, const MessageFragment& fragment) {
  if (fragment.number == 0) {
    slot.channel_size = std::min(fragment.channel.size(), slot.channel.size());
    std::copy_n(fragment.channel.begin(), slot.channel_size, slot.channel.begin());
  }
  std::copy(fragment.data.begin(), fragment.data.end(),
            bytes_.get() + slot.begin + fragment.offset);
  slot.arrived.set(fragment.number);
  slot.offsets[fragment.number] = fragment.offset;
  slot.sizes[fragment.number] = static_cast<uint32_t>(fragment.data.size());
  --slot.missing;
}

/// Whether every byte of the message is in exactly one fragment.
bool Reassembly::is_tiled(const Slot& slot) {
  uint64_t end = 0;
  for (size_t i = 0; i < slot.message.count; ++i) {
    if (slot.offsets[i] != end) return false;
    end += slot.sizes[i];
  }
  return end == slot.message.size;
}

}  // namespace v3d
