// Triggers of simulated cameras: the trigger cable, and action commands of GigE Vision.
#pragma once

#include <netinet/in.h>

#include <atomic>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>
#include <thread>
#include <vector>

#include "base/core/time.h"
#include "base/io/action_packet.h"
#include "base/io/unique_fd.h"

namespace v3d::sim {

// Server of the simulated trigger cable, a Unix socket (base/config/studio_values.h).

/// Accepts clients on a Unix socket. Each edge from a client is counted, passed to the cameras and
/// echoed to all clients. The destructor stops the thread and removes the socket file.
class TriggerCable {
 public:
  /// `edge` counts from 0. Called by the cable's thread; must not throw.
  using OnEdge = std::function<void(int64_t edge, MonotonicInstant edge_time)>;

  /// Replaces an unused socket file. Throws InputError where the path is too long for a socket or
  /// where another process listens on it.
  TriggerCable(std::filesystem::path path, OnEdge on_edge);
  ~TriggerCable();
  TriggerCable(const TriggerCable&) = delete;
  TriggerCable& operator=(const TriggerCable&) = delete;

  int64_t edges() const { return edges_; }
  /// The number of ignored, malformed packets.
  int64_t malformed() const { return malformed_; }

 private:
  void serve();
  /// Returns false where the client has disconnected.
  bool take_packet(int client);

  std::filesystem::path path_;
  OnEdge on_edge_;
  io::UniqueFd listener_;
  io::UniqueFd stop_;  ///< eventfd: readable when the thread must stop
  std::vector<io::UniqueFd> clients_;
  std::atomic<int64_t> edges_{0};
  std::atomic<int64_t> malformed_{0};
  std::thread thread_;
};

// Registers of the simulated cameras that Aravis' fake camera lacks (genicam.cc).

namespace registers {
inline constexpr uint32_t kPtpEnable = 0x310;
inline constexpr uint32_t kPtpUnlocked = 0x364;  ///< 1: the clock finds no PTP master
inline constexpr uint32_t kTriggerSource = 0x368;
inline constexpr uint32_t kActionUnconditional = 0x36c;
inline constexpr uint32_t kActionDeviceKey = 0x370;
inline constexpr uint32_t kActionSelector = 0x374;
inline constexpr uint32_t kActionGroupKey = 0x378;
inline constexpr uint32_t kActionGroupMask = 0x37c;
}  // namespace registers

/// Values of the register kTriggerSource.
enum class TriggerInput : uint32_t { kLine1 = 1, kAction1 = 2 };

/// The state of a camera that decides about action commands.
struct ActionState {
  uint32_t device_key = 0;
  uint32_t group_key = 0;
  uint32_t group_mask = 0;
  bool is_controlled = false;     ///< a program controls the camera
  bool is_unconditional = false;  ///< it obeys also without one
  bool follows_ptp = false;
};

/// Whether the camera obeys the command; otherwise it sends no acknowledgement.
bool obeys(const ActionState& camera, const io::ActionCommand& command);

/// The status of the acknowledgement of a camera that obeys. With kNoReferenceTime it exposes not
/// at all, with kLate at once. `due`: the time of a scheduled command.
io::ActionStatus status_of(const ActionState& camera, const io::ActionCommand& command,
                           MonotonicInstant due, MonotonicInstant now);

/// A time on the PTP clock, which is CLOCK_TAI of this host, on CLOCK_MONOTONIC.
MonotonicInstant from_ptp(int64_t time_ns);

/// Sends acknowledgements from the address of a camera, from a port of its own.
class AcknowledgementSocket {
 public:
  /// The address is IPv4. Throws InputError where it is not on an interface of this host.
  explicit AcknowledgementSocket(const std::string& address);
  /// Errors are ignored: acknowledgements may be lost.
  void send(const io::ActionAcknowledgement& acknowledgement, const sockaddr_in& to) const;

 private:
  io::UniqueFd socket_;
};

/// Receives action commands to the broadcast address of the loopback network, 127.255.255.255. A
/// thread of its own ends with the object.
class ActionReceiver {
 public:
  /// Called by the receiver's thread; must not throw.
  using OnCommand = std::function<void(const io::ActionCommand&, const sockaddr_in& sender)>;

  /// Throws InputError where the address cannot be bound.
  explicit ActionReceiver(OnCommand on_command);
  ~ActionReceiver();
  ActionReceiver(const ActionReceiver&) = delete;
  ActionReceiver& operator=(const ActionReceiver&) = delete;

 private:
  void run();

  const OnCommand on_command_;
  io::UniqueFd socket_;
  std::atomic<bool> stopping_ = false;
  std::thread thread_;
};

}  // namespace v3d::sim
