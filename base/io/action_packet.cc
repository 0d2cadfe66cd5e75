#include "base/io/action_packet.h"

#include <fmt/core.h>
#include <poll.h>
#include <sys/socket.h>

#include <utility>

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
  return fmt::format("status 0x{:04x}", static_cast<uint16_t>(status));
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

std::optional<ActionDatagram> receive_action_datagram(int socket, Duration timeout) {
  using std::chrono::milliseconds;
  pollfd readable{socket, POLLIN, 0};
  const auto wait = std::chrono::duration_cast<milliseconds>(timeout).count();
  if (poll(&readable, 1, static_cast<int>(wait)) <= 0) return std::nullopt;
  ActionDatagram datagram{.bytes = std::vector<uint8_t>(kHeader + kWithTime), .sender = {}};
  socklen_t length = sizeof datagram.sender;
  const ssize_t size = recvfrom(socket, datagram.bytes.data(), datagram.bytes.size(), MSG_TRUNC,
                                reinterpret_cast<sockaddr*>(&datagram.sender), &length);
  if (size < 0 || std::cmp_greater(size, datagram.bytes.size())) return std::nullopt;
  datagram.bytes.resize(static_cast<size_t>(size));
  return datagram;
}

}  // namespace v3d::io
