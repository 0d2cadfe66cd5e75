#include "daemon/control/clock_monitor.h"

#include <arpa/inet.h>
#include <sys/un.h>

#include <cmath>
#include <cstring>

namespace v3d::control {
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

namespace {

// Offsets and codes of IEEE 1588-2008, clauses 13.3 and 15; all numbers are big-endian.
constexpr uint8_t kManagement = 0x0d;
constexpr uint8_t kPtpVersion = 2;
constexpr uint8_t kManagementControl = 4;
constexpr uint8_t kNoInterval = 0x7f;
constexpr uint8_t kResponse = 2;
constexpr uint16_t kManagementTlv = 1;
constexpr uint16_t kCurrentDataSet = 0x2001;
constexpr size_t kRequestSize = 54;
constexpr size_t kPtpReplySize = 72;
constexpr size_t kLength = 2;
constexpr size_t kSequence = 30;
constexpr size_t kTarget = 34;  // ten bytes of ones: every port
constexpr size_t kAction = 46;
constexpr size_t kTlv = 48;
constexpr size_t kTlvLength = 50;
constexpr size_t kId = 52;
constexpr size_t kStepsRemoved = 54;
constexpr size_t kPtpOffset = 56;  // ns, times 2^16
constexpr double kPerSecond = 65536e9;

}  // namespace

std::vector<uint8_t> ptp_request(uint16_t sequence) {
  std::vector<uint8_t> request(kRequestSize);
  request[0] = kManagement;
  request[1] = kPtpVersion;
  put_number(request, kLength, 2, kRequestSize);
  put_number(request, kSequence, 2, sequence);
  request[kSequence + 2] = kManagementControl;
  request[kSequence + 3] = kNoInterval;
  for (size_t i = 0; i < 10; ++i) request[kTarget + i] = 0xff;
  put_number(request, kTlv, 2, kManagementTlv);
  put_number(request, kTlvLength, 2, 2);
  put_number(request, kId, 2, kCurrentDataSet);
  return request;
}

std::optional<PtpStatus> parse_ptp_reply(std::span<const uint8_t> reply, uint16_t sequence) {
  const bool is_answer =
      reply.size() == kPtpReplySize && (reply[0] & 0x0f) == kManagement &&
      (reply[1] & 0x0f) == kPtpVersion && number_at(reply, kLength, 2) == kPtpReplySize &&
      number_at(reply, kSequence, 2) == sequence && (reply[kAction] & 0x0f) == kResponse &&
      number_at(reply, kTlv, 2) == kManagementTlv && number_at(reply, kId, 2) == kCurrentDataSet;
  if (!is_answer) return std::nullopt;
  const auto offset = static_cast<int64_t>(number_at(reply, kPtpOffset, 8));
  return PtpStatus{.steps_removed = static_cast<int>(number_at(reply, kStepsRemoved, 2)),
                   .offset_s = static_cast<double>(offset) / kPerSecond};
}

PtpMonitor::PtpMonitor(std::filesystem::path root) : root_(std::move(root)), ptp4l_(AF_UNIX) {
  // The kernel assigns an abstract address for the replies, so no file remains.
  sockaddr_un own{};
  own.sun_family = AF_UNIX;
  static_cast<void>(
      bind(ptp4l_.socket_fd(), reinterpret_cast<const sockaddr*>(&own), sizeof own.sun_family));
  send_request();
}

bool PtpMonitor::send_to(const std::filesystem::path& socket,
                         std::span<const uint8_t> request) const {
  sockaddr_un there{};
  there.sun_family = AF_UNIX;
  if (socket.native().size() >= sizeof there.sun_path) return false;
  std::strcpy(there.sun_path, socket.c_str());
  return sendto(ptp4l_.socket_fd(), request.data(), request.size(), 0,
                reinterpret_cast<const sockaddr*>(&there), sizeof there) > 0;
}

void PtpMonitor::send_request() {
  const std::vector<uint8_t> request = ptp_request(++sequence_);
  is_sent_ = send_to(root_ / "run/ptp4lro", request) || send_to(root_ / "run/ptp4l", request);
}

void PtpMonitor::wait(std::chrono::milliseconds timeout) const {
  if (is_sent_) ptp4l_.wait(timeout);
}

void PtpMonitor::report(std::map<std::string, double>& values) {
  const std::optional<PtpStatus>& known = ptp4l_.receive(
      [&](std::span<const uint8_t> reply) { return parse_ptp_reply(reply, sequence_); });
  send_request();
  if (!known) return;
  values["ptp_steps_removed"] = known->steps_removed;
  if (known->steps_removed > 0) values["ptp_offset_us"] = 1e6 * known->offset_s;
}

}  // namespace v3d::control
