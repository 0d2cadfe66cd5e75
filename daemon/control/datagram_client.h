// Client of a local service (chronyd, ptp4l) that is queried periodically over a datagram socket.
#pragma once

#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

#include "base/io/big_endian.h"

namespace v3d {

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
  ~DatagramClient() {
    if (socket_ >= 0) close(socket_);
  }
  DatagramClient(const DatagramClient&) = delete;
  DatagramClient& operator=(const DatagramClient&) = delete;

  int socket_fd() const { return socket_; }

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
    pollfd answer{socket_, POLLIN, 0};
    poll(&answer, 1, static_cast<int>(timeout.count()));
  }

 private:
  static constexpr int kMaxUnanswered = 3;
  static constexpr size_t kMaxDatagramBytes = 1500;

  template <class Parse>
  std::optional<Answer> first_answer(const Parse& parse) {
    std::array<uint8_t, kMaxDatagramBytes> bytes{};
    for (;;) {
      const ssize_t size = recv(socket_, bytes.data(), bytes.size(), 0);
      if (size < 0) return std::nullopt;
      const std::span<const uint8_t> datagram(bytes.data(), static_cast<size_t>(size));
      if (const std::optional<Answer> answer = parse(datagram)) return answer;
    }
  }

  int socket_;
  int unanswered_ = 0;
  std::optional<Answer> known_;
};

}  // namespace v3d
