#include "daemon/bus/datagram.h"

#include <algorithm>
#include <cstring>

#include "base/core/bytes.h"
#include "base/core/error.h"

namespace v3d::bus {
namespace {

constexpr uint32_t kShortMagic = 0x4c433032;  // "LC02"
constexpr uint32_t kLongMagic = 0x4c433033;   // "LC03"
constexpr size_t kShortHeader = 8;
constexpr size_t kLongHeader = 20;
/// Bytes after the header of a short message and of a fragment, as in liblcm.
constexpr size_t kShortPayload = kMaxDatagram - kShortHeader;
constexpr size_t kLongPayload = kMaxDatagram - kLongHeader;

uint32_t read32(std::span<const uint8_t> bytes, size_t at) {
  return static_cast<uint32_t>(read_big_endian(bytes.subspan(at, 4)));
}
uint16_t read16(std::span<const uint8_t> bytes, size_t at) {
  return static_cast<uint16_t>(read_big_endian(bytes.subspan(at, 2)));
}

/// Reads the channel name at the front of `bytes`. Empty when there is no NUL-terminated name.
std::string_view read_channel(std::span<const uint8_t> bytes) {
  const auto* const begin = reinterpret_cast<const char*>(bytes.data());
  const size_t longest = std::min(bytes.size(), kMaxChannelName + 1);
  const void* const nul = longest == 0 ? nullptr : std::memchr(begin, '\0', longest);
  if (nul == nullptr) return {};
  return {begin, static_cast<size_t>(static_cast<const char*>(nul) - begin)};
}

/// Reads the channel after a header of `header` bytes. Returns false when there is none.
bool read_named(std::span<const uint8_t> bytes, size_t header, Datagram& datagram) {
  datagram.channel = read_channel(bytes.subspan(header));
  if (datagram.channel.empty()) return false;
  datagram.head = bytes.first(header + datagram.channel.size() + 1);
  datagram.data = bytes.subspan(datagram.head.size());
  return true;
}

std::optional<Datagram> parse_short(std::span<const uint8_t> bytes) {
  Datagram datagram;
  datagram.sequence = read32(bytes, 4);
  if (!read_named(bytes, kShortHeader, datagram)) return std::nullopt;
  datagram.message_size = static_cast<uint32_t>(datagram.data.size());
  return datagram;
}

bool is_consistent(const Datagram& d) {
  const uint64_t end = uint64_t{d.offset} + d.data.size();
  const uint64_t room = uint64_t{d.count} * kLongPayload;
  if (d.number >= d.count || d.count > kMaxFragments) return false;
  if (d.message_size > kMaxMessage || d.message_size > room || end > d.message_size) return false;
  if (d.number == 0 && d.offset != 0) return false;
  if (d.number > 0 && d.data.empty()) return false;
  return d.number + 1 < d.count || end == d.message_size;
}

std::optional<Datagram> parse_long(std::span<const uint8_t> bytes) {
  if (bytes.size() < kLongHeader) return std::nullopt;
  Datagram datagram;
  datagram.sequence = read32(bytes, 4);
  datagram.message_size = read32(bytes, 8);
  datagram.offset = read32(bytes, 12);
  datagram.number = read16(bytes, 16);
  datagram.count = read16(bytes, 18);
  if (datagram.number > 0) {
    datagram.head = bytes.first(kLongHeader);
    datagram.data = bytes.subspan(kLongHeader);
  } else if (!read_named(bytes, kLongHeader, datagram)) {
    return std::nullopt;
  }
  if (!is_consistent(datagram)) return std::nullopt;
  return datagram;
}

void put_channel(OutgoingDatagram& datagram, std::string_view channel) {
  std::memcpy(datagram.head_bytes.data() + datagram.head_size, channel.data(), channel.size());
  datagram.head_size += channel.size() + 1;  // the array is zero-initialized, so the NUL is there
}

OutgoingDatagram short_datagram(uint32_t sequence, std::string_view channel,
                                std::span<const uint8_t> message) {
  OutgoingDatagram datagram;
  const std::span<uint8_t> head(datagram.head_bytes);
  write_big_endian(kShortMagic, head.first(4));
  write_big_endian(sequence, head.subspan(4, 4));
  datagram.head_size = kShortHeader;
  put_channel(datagram, channel);
  datagram.data = message;
  return datagram;
}

OutgoingDatagram long_datagram(uint32_t sequence, size_t message_size, size_t offset, size_t number,
                               size_t count) {
  OutgoingDatagram datagram;
  const std::span<uint8_t> head(datagram.head_bytes);
  write_big_endian(kLongMagic, head.first(4));
  write_big_endian(sequence, head.subspan(4, 4));
  write_big_endian(message_size, head.subspan(8, 4));
  write_big_endian(offset, head.subspan(12, 4));
  write_big_endian(number, head.subspan(16, 2));
  write_big_endian(count, head.subspan(18, 2));
  datagram.head_size = kLongHeader;
  return datagram;
}

}  // namespace

std::optional<Datagram> parse_datagram(std::span<const uint8_t> bytes) {
  if (bytes.size() < kShortHeader) return std::nullopt;
  switch (read32(bytes, 0)) {
    case kShortMagic:
      return parse_short(bytes);
    case kLongMagic:
      return parse_long(bytes);
    default:
      return std::nullopt;
  }
}

std::vector<OutgoingDatagram> split_message(uint32_t sequence, std::string_view channel,
                                            std::span<const uint8_t> message, bool with_trailer) {
  const size_t trailer = with_trailer ? wire::kMacTrailerSize : 0;
  const size_t named = channel.size() + 1;
  if (channel.empty() || channel.size() > kMaxChannelName) return {};
  if (message.size() + trailer > kMaxMessage) return {};
  if (named + message.size() + trailer <= kShortPayload) {
    return {short_datagram(sequence, channel, message)};
  }
  const size_t payload = kLongPayload - trailer;
  const size_t count = (named + message.size() + payload - 1) / payload;
  std::vector<OutgoingDatagram> datagrams;
  datagrams.reserve(count);
  size_t offset = 0;
  for (size_t number = 0; number < count; ++number) {
    const size_t room = payload - (number == 0 ? named : 0);
    OutgoingDatagram datagram =
        long_datagram(sequence, message.size() + trailer, offset, number, count);
    if (number == 0) put_channel(datagram, channel);
    datagram.data = message.subspan(offset, std::min(room, message.size() - offset));
    offset += datagram.data.size();
    datagrams.push_back(datagram);
  }
  V3D_CHECK(offset == message.size());
  return datagrams;
}

DatagramParts split_trailer(const Datagram& datagram) {
  if (datagram.data.size() < wire::kMacTrailerSize) return {datagram.data, std::nullopt};
  const auto data = datagram.data.first(datagram.data.size() - wire::kMacTrailerSize);
  const auto trailer = wire::read_trailer(datagram.data.last<wire::kMacTrailerSize>());
  if (!trailer) return {datagram.data, std::nullopt};
  return {data, trailer};
}

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

}  // namespace v3d::bus
