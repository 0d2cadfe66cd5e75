// Client of chronyd: the error of this machine's clock.
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

/// The state of the system clock according to chronyd. Source: candm.h of chrony 4, the reply to
/// "tracking".
struct ClockTracking {
  bool synchronised = false;
  double offset_s = 0;       ///< system clock minus true time, estimated by chronyd
  double rms_offset_s = 0;   ///< root mean square of recent measurements
  double error_bound_s = 0;  ///< bound of the distance to the true time
};

/// A request for the tracking data. The reply repeats `sequence`.
std::vector<uint8_t> tracking_request(uint32_t sequence);
/// Empty for anything but the reply to the request with `sequence`. Safe for hostile input.
std::optional<ClockTracking> parse_tracking(std::span<const uint8_t> reply, uint32_t sequence);

/// Reports the error of the system clock. Queries the command port of chronyd on loopback, which is
/// open to all local processes by default. Without chronyd it checks whether systemd-timesyncd has
/// marked the clock as synchronised in /run. One thread. report() does not wait: it evaluates the
/// reply to the request of the previous call.
class ClockMonitor {
 public:
  /// chronyd's command port.
  static constexpr uint16_t kCommandPort = 323;
  /// `port`: of chronyd on 127.0.0.1. `root`: the folder that contains run/.
  explicit ClockMonitor(uint16_t port = kCommandPort, std::filesystem::path root = "/");

  /// Waits for a reply or an error of chronyd, at most `timeout`. For callers that report() once.
  void wait(std::chrono::milliseconds timeout) const { chronyd_.wait(timeout); }
  /// Adds
  ///   clock_synchronised_flag  1 or 0; omitted when neither service is present
  ///   clock_offset_us, clock_offset_rms_us, clock_error_bound_us  from chronyd, once synchronised
  void report(std::map<std::string, double>& values);

 private:
  void send_request();

  const std::filesystem::path root_;
  DatagramClient<ClockTracking> chronyd_;
  uint32_t sequence_ = 0;
};

}  // namespace v3d
