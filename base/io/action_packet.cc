#include "base/io/action_packet.h"

#include <array>

#include "base/core/bytes.h"

namespace v3d::io {
namespace {

constexpr uint8_t kKey = 0x42;  ///< first byte of every GVCP command
constexpr uint8_t kAcknowledge = 0x01;
constexpr uint8_t kScheduled = 0x80;
constexpr uint16_t kActionCommand = 0x0100;
constexpr uint16_t kActionAcknowledgement = 0x0101;
constexpr size_t kHeader = 8;
constexpr size_t kPlain = 12;     ///< payload of a command without a time, bytes
constexpr size_t kWithTime = 20;  ///< payload of a command with a time, bytes

uint64_t field(std::span<const uint8_t> datagram, size_t at, size_t size) {
  return read_big_endian(datagram.subspan(at, size));
}

}  // namespace

std::string text_of(ActionStatus status) {
  switch (status) {
    case ActionStatus::kSuccess:
      return "success";
    case ActionStatus::kNoReferenceTime:
      return "no PTP time";
    case ActionStatus::kOverflow:
      return "queue of actions full";
    case ActionStatus::kLate:
      return "command too late";
  }
  constexpr std::array kDigits = {'0', '1', '2', '3', '4', '5', '6', '7',
                                  '8', '9', 'a', 'b', 'c', 'd', 'e', 'f'};
  std::string text = "status 0x";
  for (int shift = 12; shift >= 0; shift -= 4) {
    text += kDigits[static_cast<uint16_t>(status) >> shift & 15U];
  }
  return text;
}

std::vector<uint8_t> encode(const ActionCommand& command) {
  std::vector<uint8_t> bytes = {kKey};
  const unsigned flags =
      (command.wants_acknowledgement ? kAcknowledge : 0U) | (command.time_ns ? kScheduled : 0U);
  put_big_endian(bytes, flags, 1);
  put_big_endian(bytes, kActionCommand, 2);
  put_big_endian(bytes, command.time_ns ? kWithTime : kPlain, 2);
  put_big_endian(bytes, command.request, 2);
  put_big_endian(bytes, command.device_key, 4);
  put_big_endian(bytes, command.group_key, 4);
  put_big_endian(bytes, command.group_mask, 4);
  if (command.time_ns) put_big_endian(bytes, static_cast<uint64_t>(*command.time_ns), 8);
  return bytes;
}

std::vector<uint8_t> encode(const ActionAcknowledgement& acknowledgement) {
  std::vector<uint8_t> bytes;
  put_big_endian(bytes, static_cast<uint16_t>(acknowledgement.status), 2);
  put_big_endian(bytes, kActionAcknowledgement, 2);
  put_big_endian(bytes, 0, 2);
  put_big_endian(bytes, acknowledgement.request, 2);
  return bytes;
}

std::optional<ActionCommand> decode_action_command(std::span<const uint8_t> datagram) {
  if (datagram.size() < kHeader + kPlain || datagram[0] != kKey) return std::nullopt;
  const unsigned flags = datagram[1];
  const size_t payload = (flags & kScheduled) != 0 ? kWithTime : kPlain;
  if (field(datagram, 2, 2) != kActionCommand || field(datagram, 4, 2) != payload ||
      datagram.size() != kHeader + payload || field(datagram, 6, 2) == 0) {
    return std::nullopt;
  }
  ActionCommand command;
  command.wants_acknowledgement = (flags & kAcknowledge) != 0;
  command.request = static_cast<uint16_t>(field(datagram, 6, 2));
  command.device_key = static_cast<uint32_t>(field(datagram, 8, 4));
  command.group_key = static_cast<uint32_t>(field(datagram, 12, 4));
  command.group_mask = static_cast<uint32_t>(field(datagram, 16, 4));
  if (payload == kWithTime) {
    const uint64_t time = field(datagram, 20, 8);
    if (time > INT64_MAX) return std::nullopt;
    command.time_ns = static_cast<int64_t>(time);
  }
  return command;
}

std::optional<ActionAcknowledgement> decode_action_acknowledgement(
    std::span<const uint8_t> datagram) {
  if (datagram.size() != kHeader || field(datagram, 2, 2) != kActionAcknowledgement ||
      field(datagram, 4, 2) != 0) {
    return std::nullopt;
  }
  return ActionAcknowledgement{.status = static_cast<ActionStatus>(field(datagram, 0, 2)),
                               .request = static_cast<uint16_t>(field(datagram, 6, 2))};
}

}  // namespace v3d::io
