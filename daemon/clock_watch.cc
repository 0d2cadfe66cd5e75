#include "daemon/clock_watch.h"

#include <arpa/inet.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <cmath>

namespace v3d {
namespace {

// Offsets and codes of chrony's candm.h, protocol version 6; all numbers are big-endian.
constexpr uint8_t kVersion = 6;
constexpr uint8_t kRequest = 1;
constexpr uint8_t kReply = 2;
constexpr uint16_t kTracking = 33;
constexpr uint16_t kTrackingReply = 5;
constexpr uint16_t kNotSynchronised = 3;  // the leap status
constexpr size_t kReplySize = 104;
constexpr size_t kLeapStatus = 54;
constexpr size_t kOffset = 68;  // current_correction
constexpr size_t kRmsOffset = 76;
constexpr size_t kRootDelay = 92;
constexpr size_t kRootDispersion = 96;

/// A question without an answer for so many seconds: nobody is there.
constexpr int kPatience = 3;

uint32_t number(std::span<const uint8_t> bytes, size_t at, size_t size) {
  uint32_t n = 0;
  for (size_t i = 0; i < size; ++i) n = n << 8 | bytes[at + i];
  return n;
}

void put(std::vector<uint8_t>& bytes, size_t at, size_t size, uint32_t n) {
  for (size_t i = 0; i < size; ++i) bytes[at + i] = static_cast<uint8_t>(n >> 8 * (size - 1 - i));
}

/// chrony's own: 7 bits of exponent and 25 of coefficient, both in two's complement.
double real(std::span<const uint8_t> bytes, size_t at) {
  constexpr int kCoefficientBits = 25;
  const auto word = static_cast<int32_t>(number(bytes, at, 4));
  const int exponent = word >> kCoefficientBits;
  const int32_t coefficient = static_cast<int32_t>(static_cast<uint32_t>(word) << 7) >> 7;
  return std::ldexp(static_cast<double>(coefficient), exponent - kCoefficientBits);
}

}  // namespace

std::vector<uint8_t> tracking_request(uint32_t sequence) {
  std::vector<uint8_t> request(kReplySize);  // chronyd wants a question as long as its answer
  request[0] = kVersion;
  request[1] = kRequest;
  put(request, 4, 2, kTracking);
  put(request, 8, 4, sequence);
  return request;
}

std::optional<ClockTracking> parse_tracking(std::span<const uint8_t> reply, uint32_t sequence) {
  const bool is_answer = reply.size() == kReplySize && reply[0] == kVersion && reply[1] == kReply &&
                         number(reply, 4, 2) == kTracking &&
                         number(reply, 6, 2) == kTrackingReply && number(reply, 8, 2) == 0 &&
                         number(reply, 16, 4) == sequence;
  if (!is_answer) return std::nullopt;
  // chronyd gives what it will add to the clock.
  const double offset = -real(reply, kOffset);
  return ClockTracking{.synchronised = number(reply, kLeapStatus, 2) != kNotSynchronised,
                       .offset_s = offset,
                       .rms_offset_s = real(reply, kRmsOffset),
                       .error_bound_s = std::abs(offset) + real(reply, kRootDispersion) +
                                        real(reply, kRootDelay) / 2};
}

ClockWatch::ClockWatch(uint16_t port, std::filesystem::path root)
    : root_(std::move(root)),
      socket_(socket(AF_INET, SOCK_DGRAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0)) {
  sockaddr_in chronyd{};
  chronyd.sin_family = AF_INET;
  chronyd.sin_port = htons(port);
  chronyd.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  // Where it fails, send() does.
  static_cast<void>(connect(socket_, reinterpret_cast<const sockaddr*>(&chronyd), sizeof chronyd));
  ask();
}

ClockWatch::~ClockWatch() {
  if (socket_ >= 0) close(socket_);
}

void ClockWatch::ask() {
  const std::vector<uint8_t> request = tracking_request(++sequence_);
  if (send(socket_, request.data(), request.size(), 0) < 0) {
    // The refusal of the question before; this one was not sent. Where nobody is, nothing is lost.
    send(socket_, request.data(), request.size(), 0);
  }
}

std::optional<ClockTracking> ClockWatch::hear() {
  std::array<uint8_t, 512> bytes{};
  for (;;) {
    const ssize_t size = recv(socket_, bytes.data(), bytes.size(), 0);
    if (size < 0) return std::nullopt;
    const std::span reply(bytes.data(), static_cast<size_t>(size));
    if (const auto tracking = parse_tracking(reply, sequence_)) return tracking;
  }
}

void ClockWatch::wait(std::chrono::milliseconds most) const {
  pollfd answer{socket_, POLLIN, 0};
  poll(&answer, 1, static_cast<int>(most.count()));
}

void ClockWatch::report(std::map<std::string, double>& values) {
  if (const auto heard = hear()) {
    known_ = heard;
    unanswered_ = 0;
  } else if (++unanswered_ >= kPatience) {
    known_.reset();
  }
  ask();
  if (!known_) {
    // systemd-timesyncd tells no more than that it does. The kernel's word would need adjtimex(),
    // which the daemon's sandbox has no need to allow.
    std::error_code error;
    if (std::filesystem::exists(root_ / "run/systemd/timesync/synchronized", error)) {
      values["clock_synchronised_flag"] = 1;
    }
    return;
  }
  values["clock_synchronised_flag"] = known_->synchronised ? 1 : 0;
  if (!known_->synchronised) return;
  values["clock_offset_us"] = 1e6 * known_->offset_s;
  values["clock_offset_rms_us"] = 1e6 * known_->rms_offset_s;
  values["clock_error_bound_us"] = 1e6 * known_->error_bound_s;
}

}  // namespace v3d
