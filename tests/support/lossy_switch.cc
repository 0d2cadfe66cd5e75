#include "support/lossy_switch.h"

#include <arpa/inet.h>
#include <linux/if_packet.h>
#include <net/ethernet.h>
#include <net/if.h>
#include <poll.h>
#include <sys/socket.h>
#include <unistd.h>

#include <algorithm>
#include <stdexcept>

#include "base/core/error.h"
#include "base/io/process.h"

namespace v3d::test {
namespace {

constexpr size_t kMaxFrame = 1 << 16;
constexpr size_t kIp = 14;
constexpr size_t kLcmHeader = 8;  // "LC02" and LCM's own sequence number

int open_port(const std::string& name) {
  const int fd = socket(AF_PACKET, SOCK_RAW | SOCK_CLOEXEC, htons(ETH_P_IP));
  const int yes = 1;  // no frames that the switch itself sends, which would fill the buffer
  if (fd < 0 || setsockopt(fd, SOL_PACKET, PACKET_IGNORE_OUTGOING, &yes, sizeof yes) != 0) {
    throw std::runtime_error(errno_message("switch port " + name));
  }
  sockaddr_ll address{};
  address.sll_family = AF_PACKET;
  address.sll_protocol = htons(ETH_P_IP);
  address.sll_ifindex = static_cast<int>(if_nametoindex(name.c_str()));
  if (bind(fd, reinterpret_cast<sockaddr*>(&address), sizeof address) != 0) {
    throw std::runtime_error(errno_message("switch port " + name));
  }
  // The receive buffer holds frames while the switch gets no processor time, so that it drops only
  // frames that it is to drop.
  const int room = 4 << 20;
  setsockopt(fd, SOL_SOCKET, SO_RCVBUF, &room, sizeof room);
  return fd;
}

/// Offset of the UDP header in the frame; 0 when it has none.
size_t udp_of(const std::vector<uint8_t>& frame) {
  if (frame.size() < kIp + 20 || frame[kIp + 9] != IPPROTO_UDP) return 0;
  const size_t udp = kIp + 4 * (frame[kIp] & 15U);
  return frame.size() >= udp + 8 ? udp : 0;
}

/// The LCM channel of a frame; "" when it is not an LCM message in one datagram.
std::string channel_of(const std::vector<uint8_t>& frame, size_t udp) {
  const size_t lcm = udp + 8;
  const std::string magic = "LC02";
  if (frame.size() < lcm + kLcmHeader) return "";
  if (!std::equal(magic.begin(), magic.end(), frame.begin() + static_cast<ptrdiff_t>(lcm)))
    return "";
  const auto begin = frame.begin() + static_cast<ptrdiff_t>(lcm + kLcmHeader);
  return {begin, std::find(begin, frame.end(), uint8_t{0})};
}

}  // namespace

LossySwitch::LossySwitch(const std::vector<std::string>& ports, LinkFaults faults)
    : faults_(faults), random_(faults.seed) {
  for (const std::string& port : ports) sockets_.push_back(open_port(port));
  thread_ = std::thread([this] { run(); });
}

LossySwitch::~LossySwitch() {
  stopping_ = true;
  thread_.join();
  for (const int fd : sockets_) close(fd);
}

int64_t LossySwitch::lost(const std::string& channel, size_t port) const {
  const std::lock_guard lock(mutex_);
  const auto found = lost_.find({channel, port});
  return found == lost_.end() ? 0 : found->second;
}

void LossySwitch::run() {
  make_thread_realtime();
  std::vector<pollfd> watched;
  for (const int fd : sockets_) watched.push_back({fd, POLLIN, 0});
  while (!stopping_) {
    const timespec interval{0, 1'000'000};
    ppoll(watched.data(), watched.size(), &interval, nullptr);
    for (size_t port = 0; port < watched.size(); ++port) {
      if (watched[port].revents != 0) receive_all(port);
    }
    deliver();
  }
}

void LossySwitch::receive_all(size_t port) {
  for (;;) {
    Bytes frame(kMaxFrame);
    const ssize_t n = recv(sockets_[port], frame.data(), frame.size(), MSG_DONTWAIT);
    if (n <= 0) return;
    frame.resize(static_cast<size_t>(n));
    receive(port, std::move(frame));
  }
}

void LossySwitch::receive(size_t port, Bytes frame) {
  const size_t udp = udp_of(frame);
  if (udp == 0) return;
  // The sender leaves the checksum to the network card, and a virtual link computes none. 0 means
  // that there is no checksum.
  frame[udp + 6] = frame[udp + 7] = 0;
  distribute(port, frame, channel_of(frame, udp));
}

void LossySwitch::distribute(size_t from, const Bytes& frame, const std::string& channel) {
  const MonotonicInstant now = Monotonic::now();
  std::uniform_real_distribution<> part;
  for (size_t port = 0; port < sockets_.size(); ++port) {
    if (port == from) continue;
    if (!channel.empty() && part(random_) < faults_.loss) {
      const std::lock_guard lock(mutex_);
      ++lost_[{channel, port}];
      continue;
    }
    const auto delay = from_seconds(part(random_) * to_seconds(faults_.max_delay));
    delayed_.push({now + delay, ++numbered_, port, frame});
  }
}

void LossySwitch::deliver() {
  while (!delayed_.empty() && delayed_.top().due <= Monotonic::now()) {
    const DelayedFrame& frame = delayed_.top();
    send(sockets_[frame.port], frame.bytes.data(), frame.bytes.size(), 0);
    ++forwarded_;
    delayed_.pop();
  }
}

}  // namespace v3d::test
