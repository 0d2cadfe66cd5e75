#include "sim/cameras/trigger_cable.h"

#include <poll.h>
#include <sys/eventfd.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstring>

#include "base/config/studio_values.h"
#include "base/core/error.h"
#include "base/io/process.h"

namespace v3d::sim {
namespace {

sockaddr_un socket_address(const std::filesystem::path& path) {
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  if (path.native().size() >= sizeof address.sun_path) {
    throw InputError(path.string() + ": a socket path has at most " +
                     std::to_string(sizeof address.sun_path - 1) + " characters");
  }
  std::memcpy(address.sun_path, path.c_str(), path.native().size() + 1);
  return address;
}

int open_socket() { return ::socket(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0); }

bool has_server(const sockaddr_un& address) {
  const int probe = open_socket();
  const bool answered =
      ::connect(probe, reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0;
  ::close(probe);
  return answered;
}

}  // namespace

TriggerCable::TriggerCable(std::filesystem::path path, OnEdge on_edge)
    : path_(std::move(path)), on_edge_(std::move(on_edge)) {
  const sockaddr_un address = socket_address(path_);
  if (std::filesystem::is_socket(path_)) {
    if (has_server(address)) {
      throw InputError(path_.string() + ": another simulated studio uses this socket");
    }
    std::filesystem::remove(path_);
  }
  listener_ = open_socket();
  if (listener_ < 0 ||
      ::bind(listener_, reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0 ||
      ::listen(listener_, 16) != 0) {
    const std::string message = errno_message(path_.string());
    ::close(listener_);
    throw InputError(message);
  }
  stop_ = ::eventfd(0, EFD_CLOEXEC);
  thread_ = std::thread([this] { serve(); });
}

TriggerCable::~TriggerCable() {
  const uint64_t one = 1;
  [[maybe_unused]] const ssize_t written = ::write(stop_, &one, sizeof one);
  thread_.join();
  for (const int client : clients_) {
    ::close(client);
  }
  ::close(listener_);
  ::close(stop_);
  std::error_code ignored;
  std::filesystem::remove(path_, ignored);
}

void TriggerCable::serve() {
  make_thread_realtime();
  for (;;) {
    std::vector<pollfd> watched = {{stop_, POLLIN, 0}, {listener_, POLLIN, 0}};
    for (const int client : clients_) {
      watched.push_back({client, POLLIN, 0});
    }
    if (::poll(watched.data(), watched.size(), -1) < 0 && errno != EINTR) {
      return;
    }
    if (watched[0].revents != 0) {
      return;
    }
    // Accept new clients first, so that a client gets the echo of every edge that is sent after its
    // connection.
    if (watched[1].revents != 0) {
      if (const int client = ::accept4(listener_, nullptr, nullptr, SOCK_CLOEXEC); client >= 0) {
        clients_.push_back(client);
        continue;
      }
    }
    for (size_t i = 2; i < watched.size(); ++i) {
      if (watched[i].revents != 0 && !take_packet(watched[i].fd)) {
        std::erase(clients_, watched[i].fd);
        ::close(watched[i].fd);
      }
    }
  }
}

bool TriggerCable::take_packet(int client) {
  // One byte more than an edge, to detect longer packets.
  std::array<char, sizeof(TriggerEdge) + 1> packet{};
  const ssize_t size = ::recv(client, packet.data(), packet.size(), MSG_DONTWAIT);
  if (size <= 0) {
    return size < 0 && (errno == EAGAIN || errno == EINTR);
  }
  if (size != sizeof(TriggerEdge)) {
    ++malformed_;
    return true;
  }
  TriggerEdge edge;
  std::memcpy(&edge, packet.data(), sizeof edge);
  on_edge_(edges_++, from_ns<Monotonic>(edge.edge_monotonic_ns));
  for (const int listener : clients_) {
    // A client that does not read loses edges; the others do not wait for it.
    ::send(listener, &edge, sizeof edge, MSG_DONTWAIT | MSG_NOSIGNAL);
  }
  return true;
}

}  // namespace v3d::sim
