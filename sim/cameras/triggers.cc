#include "sim/cameras/triggers.h"

#include <arpa/inet.h>
#include <poll.h>
#include <sys/eventfd.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <ctime>
#include <utility>

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

io::UniqueFd open_socket() {
  return io::UniqueFd(::socket(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC, 0));
}

bool has_server(const sockaddr_un& address) {
  const io::UniqueFd probe = open_socket();
  return ::connect(probe.get(), reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0;
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
  if (!listener_ ||
      ::bind(listener_.get(), reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0 ||
      ::listen(listener_.get(), 16) != 0) {
    throw InputError(errno_message(path_.string()));
  }
  stop_.reset(::eventfd(0, EFD_CLOEXEC));
  thread_ = std::thread([this] { serve(); });
}

TriggerCable::~TriggerCable() {
  const uint64_t one = 1;
  [[maybe_unused]] const ssize_t written = ::write(stop_.get(), &one, sizeof one);
  thread_.join();
  clients_.clear();
  listener_.reset();
  std::error_code ignored;
  std::filesystem::remove(path_, ignored);
}

void TriggerCable::serve() {
  make_thread_realtime();
  for (;;) {
    std::vector<pollfd> watched = {{stop_.get(), POLLIN, 0}, {listener_.get(), POLLIN, 0}};
    for (const io::UniqueFd& client : clients_) {
      watched.push_back({client.get(), POLLIN, 0});
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
      io::UniqueFd client(::accept4(listener_.get(), nullptr, nullptr, SOCK_CLOEXEC));
      if (client) {
        clients_.push_back(std::move(client));
        continue;
      }
    }
    for (size_t i = 2; i < watched.size(); ++i) {
      if (watched[i].revents != 0 && !take_packet(watched[i].fd)) {
        std::erase_if(clients_, [&](const auto& client) { return client.get() == watched[i].fd; });
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
  for (const io::UniqueFd& listener : clients_) {
    // A client that does not read loses edges; the others do not wait for it.
    ::send(listener.get(), &edge, sizeof edge, MSG_DONTWAIT | MSG_NOSIGNAL);
  }
  return true;
}

namespace {

constexpr char kBroadcast[] = "127.255.255.255";
constexpr Duration kPollInterval = std::chrono::milliseconds(50);

io::UniqueFd bound_socket(const std::string& address, uint16_t port) {
  io::UniqueFd fd(::socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0));
  sockaddr_in own{};
  own.sin_family = AF_INET;
  own.sin_port = htons(port);
  const int on = 1;  // Aravis' fake cameras bind the broadcast address, too
  if (inet_pton(AF_INET, address.c_str(), &own.sin_addr) != 1 ||
      setsockopt(fd.get(), SOL_SOCKET, SO_REUSEADDR, &on, sizeof on) != 0 ||
      bind(fd.get(), reinterpret_cast<const sockaddr*>(&own), sizeof own) != 0) {
    throw InputError(errno_message("action commands at " + address));
  }
  return fd;
}

}  // namespace

bool obeys(const ActionState& camera, const io::ActionCommand& command) {
  return (camera.is_controlled || camera.is_unconditional) &&
         camera.device_key == command.device_key && camera.group_key == command.group_key &&
         (camera.group_mask & command.group_mask) != 0;
}

io::ActionStatus status_of(const ActionState& camera, const io::ActionCommand& command,
                           MonotonicInstant due, MonotonicInstant now) {
  if (!command.time_ns) return io::ActionStatus::kSuccess;
  if (!camera.follows_ptp) return io::ActionStatus::kNoReferenceTime;
  return due < now ? io::ActionStatus::kLate : io::ActionStatus::kSuccess;
}

MonotonicInstant from_ptp(int64_t time_ns) {
  timespec tai{};
  clock_gettime(CLOCK_TAI, &tai);
  const int64_t now_ns = int64_t{tai.tv_sec} * 1'000'000'000 + tai.tv_nsec;
  // A year is more than any command is ahead; the limit keeps the sum within 64 bits.
  constexpr int64_t kYear = 365LL * 24 * 3600 * 1'000'000'000;
  return Monotonic::now() + Duration(std::clamp(time_ns - now_ns, -kYear, kYear));
}

AcknowledgementSocket::AcknowledgementSocket(const std::string& address)
    : socket_(bound_socket(address, 0)) {}

void AcknowledgementSocket::send(const io::ActionAcknowledgement& acknowledgement,
                                 const sockaddr_in& to) const {
  const std::vector<uint8_t> bytes = encode(acknowledgement);
  sendto(socket_.get(), bytes.data(), bytes.size(), MSG_DONTWAIT,
         reinterpret_cast<const sockaddr*>(&to), sizeof to);
}

ActionReceiver::ActionReceiver(OnCommand on_command)
    : on_command_(std::move(on_command)),
      socket_(bound_socket(kBroadcast, io::kGvcpPort)),
      thread_([this] { run(); }) {}

ActionReceiver::~ActionReceiver() {
  stopping_ = true;
  thread_.join();
}

void ActionReceiver::run() {
  make_thread_realtime();
  while (!stopping_) {
    const auto datagram = io::receive_action_datagram(socket_.get(), kPollInterval);
    if (!datagram) continue;
    const auto command = io::decode_action_command(datagram->bytes);
    if (command) on_command_(*command, datagram->sender);
  }
}

}  // namespace v3d::sim
