// Client of ptp4l: the offset of this machine's PTP clock from its master.
#pragma once

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "daemon/control/datagram_client.h"

namespace v3d {

/// Part of CURRENT_DATA_SET. Source: IEEE 1588-2008, clause 15.
struct PtpStatus {
  int steps_removed = 0;  ///< hops to the grandmaster; 0: this is the grandmaster, or there is none
  double offset_s = 0;    ///< this clock minus the master
};

/// A management message that requests it. The reply repeats `sequence`.
std::vector<uint8_t> ptp_request(uint16_t sequence);
/// Empty for anything but the reply to the request with `sequence`. Safe for hostile input.
std::optional<PtpStatus> parse_ptp_reply(std::span<const uint8_t> reply, uint16_t sequence);

/// Queries ptp4l over its socket in /run: ptp4lro, which newer versions open to all users, or
/// ptp4l, which is restricted to its owner. With software time stamps this clock is the system
/// clock; otherwise it is that of the network card, to which phc2sys synchronises the system clock.
/// One thread. report() does not wait: it evaluates the reply to the request of the previous call.
class PtpMonitor {
 public:
  /// `root`: the folder that contains run/.
  explicit PtpMonitor(std::filesystem::path root = "/");

  /// Waits for a reply, at most `timeout`. For callers that report() once.
  void wait(std::chrono::milliseconds timeout) const;
  /// Adds, while ptp4l replies:
  ///   ptp_steps_removed  hops to the grandmaster
  ///   ptp_offset_us      if steps_removed > 0
  void report(std::map<std::string, double>& values);

 private:
  void send_request();
  bool send_to(const std::filesystem::path& socket, std::span<const uint8_t> request) const;

  const std::filesystem::path root_;
  DatagramClient<PtpStatus> ptp4l_;
  uint16_t sequence_ = 0;
  bool is_sent_ = false;  ///< the last request
};

}  // namespace v3d
