#include "daemon/bus/datagram.h"

#include <algorithm>
#include <cstring>

#include "base/core/check.h"
#include "base/io/big_endian.h"

namespace v3d {
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
  const size_t trailer = with_trailer ? kMacTrailerSize : 0;
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
  if (datagram.data.size() < kMacTrailerSize) return {datagram.data, std::nullopt};
  const auto data = datagram.data.first(datagram.data.size() - kMacTrailerSize);
  const auto trailer = read_trailer(datagram.data.last<kMacTrailerSize>());
  if (!trailer) return {datagram.data, std::nullopt};
  return {data, trailer};
}

}  // namespace v3d
