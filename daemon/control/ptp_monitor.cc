#include "daemon/control/ptp_monitor.h"

#include <sys/un.h>

#include <cstring>

namespace v3d {
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

}  // namespace v3d
