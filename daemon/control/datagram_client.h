// A service of this machine that is asked a question every second over a datagram socket, and
// answers when it likes: chronyd, ptp4l.
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

/// A number of `size` bytes, big-endian. Requires at + size <= bytes.size().
inline uint64_t number_at(std::span<const uint8_t> bytes, size_t at, size_t size) {
  return read_big_endian(bytes.subspan(at, size));
}
inline void put_number(std::span<uint8_t> bytes, size_t at, size_t size, uint64_t n) {
  write_big_endian(n, bytes.subspan(at, size));
}

/// What was last heard of the service, for so long as it answers. One thread, never waits but in
/// wait().
template <class Answer>
class DatagramClient {
 public:
  /// `family`: of a datagram socket. Without one nobody is ever heard.
  explicit DatagramClient(int family)
      : socket_(socket(family, SOCK_DGRAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0)) {}
  ~DatagramClient() {
    if (socket_ >= 0) close(socket_);
  }
  DatagramClient(const DatagramClient&) = delete;
  DatagramClient& operator=(const DatagramClient&) = delete;

  int socket_fd() const { return socket_; }

  /// Takes what has arrived since the call before: the first datagram of which parse() makes an
  /// answer. After three calls without one there is nobody.
  template <class Parse>
  const std::optional<Answer>& hear(const Parse& parse) {
    if (const auto heard = first_answer(parse)) {
      known_ = heard;
      unanswered_ = 0;
    } else if (++unanswered_ >= kPatience) {
      known_.reset();
    }
    return known_;
  }

  /// Until something has arrived or cannot, but no longer than `most`.
  void wait(std::chrono::milliseconds most) const {
    pollfd answer{socket_, POLLIN, 0};
    poll(&answer, 1, static_cast<int>(most.count()));
  }

 private:
  static constexpr int kPatience = 3;
  static constexpr size_t kLongestDatagram = 1500;

  template <class Parse>
  std::optional<Answer> first_answer(const Parse& parse) {
    std::array<uint8_t, kLongestDatagram> bytes{};
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
