// Packets of GigE Vision action commands (GVCP): one command triggers all cameras that it
// addresses.
#pragma once

#include <netinet/in.h>

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "base/core/time.h"

namespace v3d::io {

/// UDP port on which GigE Vision cameras receive commands.
inline constexpr uint16_t kGvcpPort = 3956;

/// ACTION_CMD. A camera obeys when its device key and group key are the same and the masks have a
/// common bit.
struct ActionCommand {
  uint32_t device_key = 0;
  uint32_t group_key = 0;
  uint32_t group_mask = 0;
  /// Time of the action on the PTP clock, nanoseconds since its epoch, not negative; empty: at
  /// once.
  std::optional<int64_t> time_ns = {};
  uint16_t request = 1;  ///< number that the acknowledgement repeats; not 0
  bool wants_acknowledgement = true;
  friend bool operator==(const ActionCommand&, const ActionCommand&) = default;
};

/// Status codes of an acknowledgement. Others are possible.
enum class ActionStatus : uint16_t {
  kSuccess = 0,
  kNoReferenceTime = 0x8013,  ///< scheduled, but the camera's clock does not follow PTP
  kOverflow = 0x8015,         ///< the camera's queue of scheduled actions is full
  kLate = 0x8016,             ///< the time of the action has passed
};

/// "no PTP time", "queue of actions full", "command too late", or "status 0x8001".
std::string text_of(ActionStatus status);

/// ACTION_ACK.
struct ActionAcknowledgement {
  ActionStatus status = ActionStatus::kSuccess;
  uint16_t request = 1;
  friend bool operator==(const ActionAcknowledgement&, const ActionAcknowledgement&) = default;
};

/// The payload of the UDP datagram: 20 bytes, with a time 28.
std::vector<uint8_t> encode(const ActionCommand& command);
/// 8 bytes.
std::vector<uint8_t> encode(const ActionAcknowledgement& acknowledgement);

/// Empty when the datagram is not an action command of this form.
std::optional<ActionCommand> decode_action_command(std::span<const uint8_t> datagram);
/// Empty when the datagram is not an acknowledgement of an action command.
std::optional<ActionAcknowledgement> decode_action_acknowledgement(
    std::span<const uint8_t> datagram);

struct ActionDatagram {
  std::vector<uint8_t> bytes;
  sockaddr_in sender{};
};
/// The next datagram of a UDP socket. Empty when none came within `timeout`, and for one that is
/// longer than every packet of action commands.
std::optional<ActionDatagram> receive_action_datagram(int socket, Duration timeout);

}  // namespace v3d::io
