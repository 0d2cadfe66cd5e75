#include "daemon/viewd/bus_relay.h"

#include <fcntl.h>
#include <poll.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <csignal>
#include <filesystem>
#include <stdexcept>

#include "base/error.h"
#include "base/io/process.h"
#include "daemon/control/operator_client.h"
#include "daemon/viewd/child_program.h"
#include "wire/codec.h"

namespace v3d {
namespace {

constexpr size_t kHead = 5;
constexpr Duration kLook = std::chrono::milliseconds(20);
constexpr int kPipeBytes = 1 << 20;

Bytes payload_of(const Heard& heard) {
  return std::visit(
      [](const auto& message) -> Bytes {
        if constexpr (std::is_same_v<std::decay_t<decltype(message)>, NotVerified>) {
          return {message.why.begin(), message.why.end()};
        } else {
          return encode(message);
        }
      },
      heard);
}

template <class M>
std::optional<Heard> decoded(std::span<const uint8_t> bytes) {
  if (auto message = decode<M>(bytes)) return Heard(std::move(*message));
  return {};
}

std::optional<Heard> heard_of(size_t kind, std::span<const uint8_t> bytes) {
  switch (kind) {
    case 0:
      return NotVerified{{bytes.begin(), bytes.end()}};
    case 1:
      return decoded<MeshMessage>(bytes);
    case 2:
      return decoded<HealthMessage>(bytes);
    case 3:
      return decoded<EventMessage>(bytes);
    case 4:
      return decoded<PreviewMessage>(bytes);
    default:
      return {};
  }
}

/// False when nobody reads any more.
bool write_all(int fd, std::string_view bytes) {
  while (!bytes.empty()) {
    const ssize_t put = write(fd, bytes.data(), bytes.size());
    if (put < 0 && errno == EINTR) continue;
    if (put <= 0) return false;
    bytes.remove_prefix(static_cast<size_t>(put));
  }
  return true;
}

bool is_read(int fd) {
  pollfd end{fd, 0, 0};
  return poll(&end, 1, 0) == 0;  // POLLERR: the reading end is closed
}

}  // namespace

std::string heard_record(const Heard& heard) {
  const Bytes payload = payload_of(heard);
  std::string record;
  for (int byte = 0; byte < 4; ++byte) {
    record += static_cast<char>((payload.size() + 1) >> (8 * byte) & 0xff);
  }
  record += static_cast<char>(heard.index());
  record.append(payload.begin(), payload.end());
  return record;
}

void RelayReader::read(std::string_view bytes) {
  left_.append(bytes);
  size_t at = 0;
  while (left_.size() - at >= kHead) {
    size_t size = 0;
    for (size_t byte = 0; byte < 4; ++byte) {
      size |= static_cast<size_t>(static_cast<uint8_t>(left_[at + byte])) << (8 * byte);
    }
    if (size == 0 || size > kMaxBytes) throw std::runtime_error("what is heard has no such record");
    if (left_.size() - at < 4 + size) break;
    const auto* payload = reinterpret_cast<const uint8_t*>(left_.data()) + at + kHead;
    auto heard = heard_of(static_cast<uint8_t>(left_[at + 4]), {payload, size - 1});
    if (heard) heard_.push_back(std::move(*heard));  // what came of the network ends nobody
    at += 4 + size;
  }
  left_.erase(0, at);
}

std::optional<Heard> RelayReader::next() {
  if (heard_.empty()) return {};
  Heard heard = std::move(heard_.front());
  heard_.pop_front();
  return heard;
}

void tell_what_is_heard(const Studio& studio, int to) {
  std::signal(SIGPIPE, SIG_IGN);
  OperatorClient client(studio);
  bool told = write_all(to, heard_record(NotVerified{client.not_verified()}));
  const auto tell = [&](const auto& message) {
    if (message) told = told && write_all(to, heard_record(*message));
    return message.has_value();
  };
  while (told && is_read(to)) {
    tell(client.next_mesh(Monotonic::now() + kLook));
    const MonotonicInstant now = Monotonic::now();
    while (tell(client.next_health(now))) continue;
    while (tell(client.next_event(now))) continue;
    while (tell(client.next_preview(now))) continue;
  }
}

BusRelay::BusRelay(const Studio& studio, const std::string& flag) {
  std::array<int, 2> pipe{-1, -1};
  if (pipe2(pipe.data(), O_CLOEXEC) != 0) throw std::runtime_error(errno_message("pipe"));
  fcntl(pipe[1], F_SETPIPE_SZ, kPipeBytes);
  from_ = pipe[0];
  fcntl(from_, F_SETFL, O_NONBLOCK);
  const std::string self = std::filesystem::read_symlink("/proc/self/exe");
  child_ = spawn_program({self, "--studio", studio.path, flag}, pipe[1], STDERR_FILENO);
  close(pipe[1]);
  if (child_ < 0) throw std::runtime_error(errno_message("cannot run " + self));
}

BusRelay::~BusRelay() {
  close(from_);
  kill_process(child_);
}

void BusRelay::wait(MonotonicInstant deadline) {
  const auto left = std::chrono::ceil<std::chrono::milliseconds>(deadline - Monotonic::now());
  pollfd ready{from_, POLLIN, 0};
  poll(&ready, 1, static_cast<int>(std::max<int64_t>(0, left.count())));
  std::array<char, 65536> part{};
  for (int bytes = 0; bytes < kPipeBytes;) {  // whoever tells without end does not hold us up
    const ssize_t got = read(from_, part.data(), part.size());
    if (got < 0 && errno == EINTR) continue;
    if (got < 0) return;
    if (got == 0) throw BusRelayEnded("the process that hears the studio has ended");
    reader_.read({part.data(), static_cast<size_t>(got)});
    bytes += static_cast<int>(got);
  }
}

}  // namespace v3d
