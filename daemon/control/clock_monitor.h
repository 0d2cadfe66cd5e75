// Clients of chronyd and ptp4l.
#pragma once

#include <poll.h>
#include <sys/socket.h>

#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "base/core/bytes.h"
#include "base/io/unique_fd.h"

namespace v3d::control {

// Client of a local service (chronyd, ptp4l) that is queried periodically over a datagram socket.

/// The big-endian number of `size` bytes at `at`. Requires at + size <= bytes.size().
inline uint64_t number_at(std::span<const uint8_t> bytes, size_t at, size_t size) {
  return read_big_endian(bytes.subspan(at, size));
}
inline void put_number(std::span<uint8_t> bytes, size_t at, size_t size, uint64_t n) {
  write_big_endian(n, bytes.subspan(at, size));
}

/// Holds the last answer of the service while it replies. The owner sends the requests. One thread.
/// No function blocks except wait().
template <class Answer>
class DatagramClient {
 public:
  /// `family`: AF_INET, AF_UNIX. If no socket can be opened, no answer is ever received.
  explicit DatagramClient(int family)
      : socket_(socket(family, SOCK_DGRAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0)) {}
  DatagramClient(const DatagramClient&) = delete;
  DatagramClient& operator=(const DatagramClient&) = delete;

  int socket_fd() const { return socket_.get(); }

  /// Reads the datagrams that have arrived, up to the first that parse() accepts, and returns its
  /// answer. Returns the previous answer while none arrives, and empty after kMaxUnanswered calls.
  template <class Parse>
  const std::optional<Answer>& receive(const Parse& parse) {
    if (const auto answer = first_answer(parse)) {
      known_ = answer;
      unanswered_ = 0;
    } else if (++unanswered_ >= kMaxUnanswered) {
      known_.reset();
    }
    return known_;
  }

  /// Waits for a datagram or a socket error, at most `timeout`.
  void wait(std::chrono::milliseconds timeout) const {
    pollfd answer{socket_.get(), POLLIN, 0};
    poll(&answer, 1, static_cast<int>(timeout.count()));
  }

 private:
  static constexpr int kMaxUnanswered = 3;
  static constexpr size_t kMaxDatagramBytes = 1500;

  template <class Parse>
  std::optional<Answer> first_answer(const Parse& parse) {
    std::array<uint8_t, kMaxDatagramBytes> bytes{};
    for (;;) {
      const ssize_t size = recv(socket_.get(), bytes.data(), bytes.size(), 0);
      if (size < 0) return std::nullopt;
      const std::span<const uint8_t> datagram(bytes.data(), static_cast<size_t>(size));
      if (const std::optional<Answer> answer = parse(datagram)) return answer;
    }
  }

  const io::UniqueFd socket_;
  int unanswered_ = 0;
  std::optional<Answer> known_;
};

// Client of chronyd: the error of this machine's clock.

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
  ///   clock_synchronised_flag  1 or 0; omitted when chronyd does not reply and systemd-timesyncd
  ///                            does not run or has not synchronised the clock
  ///   clock_offset_us, clock_offset_rms_us, clock_error_bound_us  from chronyd, once synchronised
  void report(std::map<std::string, double>& values);

 private:
  void send_request();

  const std::filesystem::path root_;
  DatagramClient<ClockTracking> chronyd_;
  uint32_t sequence_ = 0;
};

// Client of ptp4l: the offset of this machine's PTP clock from its master.

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

}  // namespace v3d::control
