#include "trigger/wire_socket.h"

#include <poll.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <string>

#include "base/core/error.h"
#include "trigger/host_clock.h"

namespace v3d {
WireSocket::WireSocket(const std::filesystem::path& path) {
  const std::string name = path.string();
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  if (name.empty() || name.size() >= sizeof(address.sun_path)) {
    throw InputError("trigger wire '" + name + "': a socket path has 1 to " +
                     std::to_string(sizeof(address.sun_path) - 1) + " characters");
  }
  std::memcpy(address.sun_path, name.data(), name.size());
  fd_ = socket(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
  if (fd_ < 0 || connect(fd_, reinterpret_cast<sockaddr*>(&address), sizeof(address)) != 0) {
    const std::string cause = errno_message("trigger wire " + name);
    if (fd_ >= 0) close(fd_);
    throw InputError(cause + "; is the simulated studio running?");
  }
}

WireSocket::~WireSocket() { close(fd_); }

bool WireSocket::send(const TriggerEdge& edge) {
  if (!disconnected_ && ::send(fd_, &edge, sizeof(edge), MSG_NOSIGNAL) != sizeof(edge)) {
    disconnected_ = true;
  }
  return !disconnected_;
}

std::optional<TriggerEdge> WireSocket::receive_now() {
  TriggerEdge edge;
  const ssize_t n = recv(fd_, &edge, sizeof(edge), MSG_TRUNC);
  if (n == sizeof(edge)) return edge;
  // End of file, errors and packets of another size mean that the cable cannot be used.
  const bool nothing_there = n < 0 && (errno == EAGAIN || errno == EINTR);
  disconnected_ = disconnected_ || !nothing_there;
  return {};
}

std::optional<TriggerEdge> WireSocket::receive(MonotonicInstant deadline) {
  while (!disconnected_) {
    if (auto edge = receive_now()) return edge;
    const Duration left = deadline - Monotonic::now();
    if (disconnected_ || left <= Duration::zero()) break;
    const timespec timeout = to_timespec(left);
    pollfd readable{fd_, POLLIN, 0};
    ppoll(&readable, 1, &timeout, nullptr);
  }
  return {};
}

void WireSocket::drain() {
  while (receive_now()) {
  }
}

}  // namespace v3d
