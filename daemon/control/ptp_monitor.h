// How far the clock that ptp4l holds on this machine is from its PTP master.
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

/// IEEE 1588's CURRENT_DATA_SET, as far as it matters here.
struct PtpStatus {
  int steps_removed = 0;  ///< hops to the grandmaster; 0: this clock is it, or has found none
  double offset_s = 0;    ///< the clock minus its master's
};

/// A management message that asks for it. `sequence` comes back in the reply.
std::vector<uint8_t> ptp_request(uint16_t sequence);
/// Bytes are hostile: anything but the reply to that request gives nothing.
std::optional<PtpStatus> parse_ptp_reply(std::span<const uint8_t> reply, uint16_t sequence);

/// Asks ptp4l over its socket in /run (ptp4lro, which newer ones open to everybody, or ptp4l, whose
/// owner decides). What ptp4l holds is the system's clock where it stamps packets in software; else
/// it is that of the network card, which phc2sys carries on to the system's. One thread, never
/// waits: a question is answered at the next call.
class PtpMonitor {
 public:
  /// `root`: where run/ is.
  explicit PtpMonitor(std::filesystem::path root = "/");

  /// Until ptp4l has answered, but no longer than `most`. For those who look once.
  void wait(std::chrono::milliseconds most) const;
  /// Adds, while ptp4l answers:
  ///   ptp_steps_removed  hops to the grandmaster
  ///   ptp_offset_us      where there are any
  void report(std::map<std::string, double>& values);

 private:
  void ask();
  bool send_to(const std::filesystem::path& socket, std::span<const uint8_t> request) const;

  const std::filesystem::path root_;
  DatagramClient<PtpStatus> ptp4l_;
  uint16_t sequence_ = 0;
  bool asked_ = false;
};

}  // namespace v3d
