#include "sim/cameras/action_commands.h"

#include <arpa/inet.h>
#include <sys/socket.h>

#include <algorithm>
#include <ctime>
#include <utility>

#include "base/core/error.h"
#include "base/io/process.h"

namespace v3d::sim {
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
