// Raw LCM datagrams: composed, sent and received without the bus.
#pragma once

#include <arpa/inet.h>
#include <linux/filter.h>
#include <netinet/in.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <array>
#include <cstdint>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

#include "base/config/studio_values.h"
#include "base/core/time.h"

namespace v3d::test {

using RawDatagram = std::vector<uint8_t>;

inline void put32(RawDatagram& bytes, uint32_t value) {
  for (int shift = 24; shift >= 0; shift -= 8) {
    bytes.push_back(static_cast<uint8_t>(value >> shift));
  }
}
inline void put_text(RawDatagram& bytes, std::string_view text) {
  bytes.insert(bytes.end(), text.begin(), text.end());
}

/// The header of a short message, followed by `channel` without a NUL.
inline RawDatagram short_datagram(uint32_t sequence, std::string_view channel) {
  RawDatagram bytes = {'L', 'C', '0', '2'};
  put32(bytes, sequence);
  put_text(bytes, channel);
  return bytes;
}

struct RawFragment {
  uint32_t sequence = 0;
  uint32_t message_size = 0;
  uint32_t offset = 0;
  uint16_t number = 0;
  uint16_t count = 2;
};
/// The header of a fragment. The caller appends the channel with its NUL for number 0, and the
/// data.
inline RawDatagram fragment_header(const RawFragment& fragment) {
  RawDatagram bytes = {'L', 'C', '0', '3'};
  for (const uint32_t field : {fragment.sequence, fragment.message_size, fragment.offset}) {
    put32(bytes, field);
  }
  put32(bytes, static_cast<uint32_t>(fragment.number) << 16 | fragment.count);
  return bytes;
}

/// Sends datagrams to a multicast group and receives those that any process sends to it.
class RawSocket {
 public:
  /// `url`: an LCM URL (udpm). Throws std::runtime_error when the group cannot be joined.
  explicit RawSocket(const std::string& url) {
    const auto group = lcm_group(url).value();
    group_.sin_family = AF_INET;
    group_.sin_port = htons(group.port);
    inet_pton(AF_INET, group.address.c_str(), &group_.sin_addr);
    const int on = 1;
    const int buffer_bytes = 4 << 20;
    ip_mreq membership{};
    membership.imr_multiaddr = group_.sin_addr;
    setsockopt(listener_, SOL_SOCKET, SO_REUSEADDR, &on, sizeof on);
    setsockopt(listener_, SOL_SOCKET, SO_RCVBUF, &buffer_bytes, sizeof buffer_bytes);
    if (bind(listener_, generic(), sizeof group_) != 0 ||
        setsockopt(listener_, IPPROTO_IP, IP_ADD_MEMBERSHIP, &membership, sizeof membership) != 0) {
      throw std::runtime_error("cannot join " + url);
    }
  }
  ~RawSocket() {
    close(sender_);
    close(listener_);
  }
  RawSocket(const RawSocket&) = delete;
  RawSocket& operator=(const RawSocket&) = delete;

  /// The kernel drops what this object sends before it reaches receive(), where it could displace
  /// datagrams of others. Throws std::runtime_error.
  void ignore_own() const {
    sockaddr_in own{};
    own.sin_family = AF_INET;
    socklen_t size = sizeof own;
    auto* const address = reinterpret_cast<sockaddr*>(&own);
    // The filter gets the UDP header, which begins with the source port.
    std::array<sock_filter, 4> filter = {{{BPF_LD | BPF_H | BPF_ABS, 0, 0, 0},
                                          {BPF_JMP | BPF_JEQ | BPF_K, 0, 1, 0},
                                          {BPF_RET | BPF_K, 0, 0, 0},
                                          {BPF_RET | BPF_K, 0, 0, UINT32_MAX}}};
    bool is_done = bind(sender_, address, size) == 0 && getsockname(sender_, address, &size) == 0;
    filter[1].k = ntohs(own.sin_port);
    const sock_fprog program = {filter.size(), filter.data()};
    is_done = is_done &&
              setsockopt(listener_, SOL_SOCKET, SO_ATTACH_FILTER, &program, sizeof program) == 0;
    if (!is_done) throw std::runtime_error("cannot filter the datagrams of a socket");
  }

  void send(const RawDatagram& bytes) const {
    sendto(sender_, bytes.data(), bytes.size(), 0, generic(), sizeof group_);
  }
  /// The next datagram of the group; empty when none arrives within `wait`.
  RawDatagram receive(Duration wait) const {
    pollfd watched = {listener_, POLLIN, 0};
    const auto ms = std::chrono::duration_cast<std::chrono::milliseconds>(wait).count();
    if (poll(&watched, 1, static_cast<int>(ms)) <= 0) return {};
    RawDatagram bytes(65'536);
    const ssize_t size = recv(listener_, bytes.data(), bytes.size(), 0);
    bytes.resize(size > 0 ? static_cast<size_t>(size) : 0);
    return bytes;
  }
  /// Receives until there are `count` datagrams or none arrives within `wait`.
  std::vector<RawDatagram> receive_all(size_t count, Duration wait) const {
    std::vector<RawDatagram> all;
    while (all.size() < count) {
      all.push_back(receive(wait));
      if (all.back().empty()) {
        all.pop_back();
        break;
      }
    }
    return all;
  }

 private:
  const sockaddr* generic() const { return reinterpret_cast<const sockaddr*>(&group_); }
  const int sender_ = socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
  const int listener_ = socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
  sockaddr_in group_{};
};

}  // namespace v3d::test
