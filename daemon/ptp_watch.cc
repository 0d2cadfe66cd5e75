#include "daemon/ptp_watch.h"

#include <poll.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <array>
#include <cstddef>
#include <cstring>

namespace v3d {
namespace {

// Offsets and codes of IEEE 1588-2008, clauses 13.3 and 15; all numbers are big-endian.
constexpr uint8_t kManagement = 0x0d;
constexpr uint8_t kVersion = 2;
constexpr uint8_t kManagementControl = 4;
constexpr uint8_t kNoInterval = 0x7f;
constexpr uint8_t kResponse = 2;
constexpr uint16_t kManagementTlv = 1;
constexpr uint16_t kCurrentDataSet = 0x2001;
constexpr size_t kRequestSize = 54;
constexpr size_t kReplySize = 72;
constexpr size_t kLength = 2;
constexpr size_t kSequence = 30;
constexpr size_t kTarget = 34;  // ten bytes of ones: every port
constexpr size_t kAction = 46;
constexpr size_t kTlv = 48;
constexpr size_t kTlvLength = 50;
constexpr size_t kId = 52;
constexpr size_t kStepsRemoved = 54;
constexpr size_t kOffset = 56;  // ns, times 2^16
constexpr double kPerSecond = 65536e9;

/// A question without an answer for so many seconds: nobody is there.
constexpr int kPatience = 3;

void put(std::vector<uint8_t>& bytes, size_t at, uint16_t n) {
  bytes[at] = static_cast<uint8_t>(n >> 8);
  bytes[at + 1] = static_cast<uint8_t>(n);
}

uint64_t number(std::span<const uint8_t> bytes, size_t at, size_t size) {
  uint64_t n = 0;
  for (size_t i = 0; i < size; ++i) n = n << 8 | bytes[at + i];
  return n;
}

}  // namespace

std::vector<uint8_t> ptp_request(uint16_t sequence) {
  std::vector<uint8_t> request(kRequestSize);
  request[0] = kManagement;
  request[1] = kVersion;
  put(request, kLength, kRequestSize);
  put(request, kSequence, sequence);
  request[kSequence + 2] = kManagementControl;
  request[kSequence + 3] = kNoInterval;
  for (size_t i = 0; i < 10; ++i) request[kTarget + i] = 0xff;
  put(request, kTlv, kManagementTlv);
  put(request, kTlvLength, 2);
  put(request, kId, kCurrentDataSet);
  return request;
}

std::optional<PtpStanding> parse_ptp_reply(std::span<const uint8_t> reply, uint16_t sequence) {
  const bool is_answer =
      reply.size() == kReplySize && (reply[0] & 0x0f) == kManagement &&
      (reply[1] & 0x0f) == kVersion && number(reply, kLength, 2) == kReplySize &&
      number(reply, kSequence, 2) == sequence && (reply[kAction] & 0x0f) == kResponse &&
      number(reply, kTlv, 2) == kManagementTlv && number(reply, kId, 2) == kCurrentDataSet;
  if (!is_answer) return std::nullopt;
  const auto offset = static_cast<int64_t>(number(reply, kOffset, 8));
  return PtpStanding{.steps_removed = static_cast<int>(number(reply, kStepsRemoved, 2)),
                     .offset_s = static_cast<double>(offset) / kPerSecond};
}

PtpWatch::PtpWatch(std::filesystem::path root)
    : root_(std::move(root)),
      socket_(socket(AF_UNIX, SOCK_DGRAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0)) {
  // A name of its own, given by the kernel, where ptp4l answers; nothing is left in a folder.
  sockaddr_un here{};
  here.sun_family = AF_UNIX;
  static_cast<void>(
      bind(socket_, reinterpret_cast<const sockaddr*>(&here), sizeof here.sun_family));
  ask();
}

PtpWatch::~PtpWatch() {
  if (socket_ >= 0) close(socket_);
}

bool PtpWatch::send_to(const std::filesystem::path& socket,
                       std::span<const uint8_t> request) const {
  sockaddr_un there{};
  there.sun_family = AF_UNIX;
  if (socket.native().size() >= sizeof there.sun_path) return false;
  std::strcpy(there.sun_path, socket.c_str());
  return sendto(socket_, request.data(), request.size(), 0,
                reinterpret_cast<const sockaddr*>(&there), sizeof there) > 0;
}

void PtpWatch::ask() {
  const std::vector<uint8_t> request = ptp_request(++sequence_);
  asked_ = send_to(root_ / "run/ptp4lro", request) || send_to(root_ / "run/ptp4l", request);
}

std::optional<PtpStanding> PtpWatch::hear() {
  std::array<uint8_t, 1500> bytes{};
  for (;;) {
    const ssize_t size = recv(socket_, bytes.data(), bytes.size(), 0);
    if (size < 0) return std::nullopt;
    const std::span reply(bytes.data(), static_cast<size_t>(size));
    if (const auto standing = parse_ptp_reply(reply, sequence_)) return standing;
  }
}

void PtpWatch::wait(std::chrono::milliseconds most) const {
  if (!asked_) return;
  pollfd answer{socket_, POLLIN, 0};
  poll(&answer, 1, static_cast<int>(most.count()));
}

void PtpWatch::report(std::map<std::string, double>& values) {
  if (const auto heard = hear()) {
    known_ = heard;
    unanswered_ = 0;
  } else if (++unanswered_ >= kPatience) {
    known_.reset();
  }
  ask();
  if (!known_) return;
  values["ptp_steps_removed"] = known_->steps_removed;
  if (known_->steps_removed > 0) values["ptp_offset_us"] = 1e6 * known_->offset_s;
}

}  // namespace v3d
