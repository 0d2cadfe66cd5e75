// How far this machine's clock is from the right time.
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

/// What chronyd tells of the system's clock (candm.h of chrony 4: the reply to "tracking").
struct ClockTracking {
  bool synchronised = false;
  double offset_s = 0;       ///< the system's clock minus the right time, as chronyd estimates it
  double rms_offset_s = 0;   ///< of the last measurements
  double error_bound_s = 0;  ///< the true time is not farther away than this
};

/// A request for the tracking data. `sequence` comes back in the reply.
std::vector<uint8_t> tracking_request(uint32_t sequence);
/// Bytes are hostile: anything but the reply to that request gives nothing.
std::optional<ClockTracking> parse_tracking(std::span<const uint8_t> reply, uint32_t sequence);

/// Asks chronyd over its command port on loopback, which it opens to everybody on the machine by
/// default; where no chronyd answers, systemd-timesyncd's mark in /run is looked for. One thread,
/// never waits: a question is answered at the next call.
class ClockMonitor {
 public:
  /// chronyd's command port.
  static constexpr uint16_t kCommandPort = 323;
  /// `port` on 127.0.0.1: where chronyd is asked. `root`: where run/ is.
  explicit ClockMonitor(uint16_t port = kCommandPort, std::filesystem::path root = "/");

  /// Until chronyd has answered or cannot, but no longer than `most`. For those who look once.
  void wait(std::chrono::milliseconds most) const { chronyd_.wait(most); }
  /// Adds
  ///   clock_synchronised_flag  1 or 0; left out when nobody can be asked
  ///   clock_offset_us, clock_offset_rms_us, clock_error_bound_us  from chronyd, once synchronised
  void report(std::map<std::string, double>& values);

 private:
  void ask();

  const std::filesystem::path root_;
  DatagramClient<ClockTracking> chronyd_;
  uint32_t sequence_ = 0;
};

}  // namespace v3d
