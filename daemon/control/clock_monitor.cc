#include "daemon/control/clock_monitor.h"

#include <arpa/inet.h>

#include <cmath>

namespace v3d {
namespace {

// Offsets and codes of chrony's candm.h, protocol version 6; all numbers are big-endian.
constexpr uint8_t kChronyVersion = 6;
constexpr uint8_t kRequest = 1;
constexpr uint8_t kReply = 2;
constexpr uint16_t kTracking = 33;
constexpr uint16_t kTrackingReply = 5;
constexpr uint16_t kNotSynchronised = 3;  // the leap status
constexpr size_t kChronyReplySize = 104;
constexpr size_t kLeapStatus = 54;
constexpr size_t kChronyOffset = 68;  // current_correction
constexpr size_t kRmsOffset = 76;
constexpr size_t kRootDelay = 92;
constexpr size_t kRootDispersion = 96;

/// A number in chrony's own format: 7 bits of exponent and 25 of coefficient, both in two's
/// complement.
double real(std::span<const uint8_t> bytes, size_t at) {
  constexpr int kCoefficientBits = 25;
  const auto word = static_cast<int32_t>(number_at(bytes, at, 4));
  const int exponent = word >> kCoefficientBits;
  const int32_t coefficient = static_cast<int32_t>(static_cast<uint32_t>(word) << 7) >> 7;
  return std::ldexp(static_cast<double>(coefficient), exponent - kCoefficientBits);
}

}  // namespace

std::vector<uint8_t> tracking_request(uint32_t sequence) {
  std::vector<uint8_t> request(kChronyReplySize);  // chronyd requires requests as long as the reply
  request[0] = kChronyVersion;
  request[1] = kRequest;
  put_number(request, 4, 2, kTracking);
  put_number(request, 8, 4, sequence);
  return request;
}

std::optional<ClockTracking> parse_tracking(std::span<const uint8_t> reply, uint32_t sequence) {
  const bool is_answer = reply.size() == kChronyReplySize && reply[0] == kChronyVersion &&
                         reply[1] == kReply && number_at(reply, 4, 2) == kTracking &&
                         number_at(reply, 6, 2) == kTrackingReply && number_at(reply, 8, 2) == 0 &&
                         number_at(reply, 16, 4) == sequence;
  if (!is_answer) return std::nullopt;
  // current_correction is what chronyd will add to the clock.
  const double offset = -real(reply, kChronyOffset);
  return ClockTracking{.synchronised = number_at(reply, kLeapStatus, 2) != kNotSynchronised,
                       .offset_s = offset,
                       .rms_offset_s = real(reply, kRmsOffset),
                       .error_bound_s = std::abs(offset) + real(reply, kRootDispersion) +
                                        real(reply, kRootDelay) / 2};
}

ClockMonitor::ClockMonitor(uint16_t port, std::filesystem::path root)
    : root_(std::move(root)), chronyd_(AF_INET) {
  sockaddr_in there{};
  there.sin_family = AF_INET;
  there.sin_port = htons(port);
  there.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  // If connect() fails, so does send().
  static_cast<void>(
      connect(chronyd_.socket_fd(), reinterpret_cast<const sockaddr*>(&there), sizeof there));
  send_request();
}

void ClockMonitor::send_request() {
  const std::vector<uint8_t> request = tracking_request(++sequence_);
  if (send(chronyd_.socket_fd(), request.data(), request.size(), 0) < 0) {
    // send() returned the error of the previous request (connection refused) and sent nothing.
    send(chronyd_.socket_fd(), request.data(), request.size(), 0);
  }
}

void ClockMonitor::report(std::map<std::string, double>& values) {
  const std::optional<ClockTracking>& known = chronyd_.receive(
      [&](std::span<const uint8_t> reply) { return parse_tracking(reply, sequence_); });
  send_request();
  if (!known) {
    // systemd-timesyncd reports only that it has synchronised the clock. The kernel's status would
    // need adjtimex(), which the sandbox of the daemons does not allow.
    std::error_code error;
    if (std::filesystem::exists(root_ / "run/systemd/timesync/synchronized", error)) {
      values["clock_synchronised_flag"] = 1;
    }
    return;
  }
  values["clock_synchronised_flag"] = known->synchronised ? 1 : 0;
  if (!known->synchronised) return;
  values["clock_offset_us"] = 1e6 * known->offset_s;
  values["clock_offset_rms_us"] = 1e6 * known->rms_offset_s;
  values["clock_error_bound_us"] = 1e6 * known->error_bound_s;
}

}  // namespace v3d
