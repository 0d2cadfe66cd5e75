#include "daemon/viewd/bus_relay.h"

#include <fcntl.h>
#include <poll.h>
#include <spdlog/spdlog.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <csignal>
#include <filesystem>
#include <stdexcept>

#include "base/core/error.h"
#include "base/io/child_process.h"
#include "base/io/process.h"
#include "daemon/control/operator_client.h"
#include "daemon/viewd/dropped_meshes.h"
#include "wire/codec.h"

namespace v3d::viewd {
namespace {

constexpr size_t kHeaderBytes = 5;
constexpr Duration kPollPeriod = std::chrono::milliseconds(20);
constexpr int kPipeBytes = 1 << 20;

wire::Bytes payload_of(const RelayedMessage& relayed) {
  return std::visit(
      [](const auto& message) -> wire::Bytes {
        if constexpr (std::is_same_v<std::decay_t<decltype(message)>, NotVerified>) {
          return {message.why.begin(), message.why.end()};
        } else {
          return encode(message);
        }
      },
      relayed);
}

template <class M>
std::optional<RelayedMessage> decoded(std::span<const uint8_t> bytes) {
  if (auto message = wire::decode<M>(bytes)) return RelayedMessage(std::move(*message));
  return {};
}

std::optional<RelayedMessage> decode_payload(size_t kind, std::span<const uint8_t> bytes) {
  switch (kind) {
    case 0:
      return NotVerified{{bytes.begin(), bytes.end()}};
    case 1:
      return decoded<wire::MeshMessage>(bytes);
    case 2:
      return decoded<wire::HealthMessage>(bytes);
    case 3:
      return decoded<wire::EventMessage>(bytes);
    case 4:
      return decoded<wire::PreviewMessage>(bytes);
    default:
      return {};
  }
}

/// Returns false if the reading end is closed.
bool write_all(int fd, std::string_view bytes) {
  while (!bytes.empty()) {
    const ssize_t put = write(fd, bytes.data(), bytes.size());
    if (put < 0 && errno == EINTR) continue;
    if (put <= 0) return false;
    bytes.remove_prefix(static_cast<size_t>(put));
  }
  return true;
}

bool has_reader(int fd) {
  pollfd end{fd, 0, 0};
  return poll(&end, 1, 0) == 0;  // POLLERR: the reading end is closed
}

}  // namespace

std::string encode_record(const RelayedMessage& message) {
  const wire::Bytes payload = payload_of(message);
  std::string record;
  for (int byte = 0; byte < 4; ++byte) {
    record += static_cast<char>((payload.size() + 1) >> (8 * byte) & 0xff);
  }
  record += static_cast<char>(message.index());
  record.append(payload.begin(), payload.end());
  return record;
}

void RelayReader::read(std::string_view bytes) {
  buffer_.append(bytes);
  size_t at = 0;
  while (buffer_.size() - at >= kHeaderBytes) {
    size_t size = 0;
    for (size_t byte = 0; byte < 4; ++byte) {
      size |= static_cast<size_t>(static_cast<uint8_t>(buffer_[at + byte])) << (8 * byte);
    }
    if (size == 0 || size > kMaxBytes)
      throw std::runtime_error("the bus relay sent a record of an invalid size");
    if (buffer_.size() - at < 4 + size) break;
    const auto* payload = reinterpret_cast<const uint8_t*>(buffer_.data()) + at + kHeaderBytes;
    auto message = decode_payload(static_cast<uint8_t>(buffer_[at + 4]), {payload, size - 1});
    if (message) messages_.push_back(std::move(*message));
    at += 4 + size;
  }
  buffer_.erase(0, at);
}

std::optional<RelayedMessage> RelayReader::next() {
  if (messages_.empty()) return {};
  RelayedMessage message = std::move(messages_.front());
  messages_.pop_front();
  return message;
}

void relay_bus(const Studio& studio, int to) {
  std::signal(SIGPIPE, SIG_IGN);
  control::OperatorClient client(studio);
  bool is_open = true;
  DroppedMeshes dropped;
  std::optional<std::string> reason;  // why messages are not verified, as sent last
  const auto relay = [&](const auto& message) {
    if (message) is_open = is_open && write_all(to, encode_record(*message));
    return message.has_value();
  };
  while (is_open && has_reader(to)) {
    if (const std::string why = client.not_verified(); why != reason) {
      is_open = write_all(to, encode_record(NotVerified{why}));
      reason = why;
    }
    relay(client.next_mesh(Monotonic::now() + kPollPeriod));
    const MonotonicInstant now = Monotonic::now();
    if (const auto line = dropped.line_of_relay(client.dropped_meshes(), now)) {
      spdlog::warn("{}", *line);
    }
    while (relay(client.next_health(now))) continue;
    while (relay(client.next_event(now))) continue;
    while (relay(client.next_preview(now))) continue;
  }
}

BusRelay::BusRelay(const Studio& studio, const std::string& flag) {
  std::array<int, 2> ends{-1, -1};
  if (pipe2(ends.data(), O_CLOEXEC) != 0) throw std::runtime_error(errno_message("pipe"));
  fcntl(ends[1], F_SETPIPE_SZ, kPipeBytes);
  pipe_.reset(ends[0]);
  const io::UniqueFd end_of_child(ends[1]);
  fcntl(pipe_.get(), F_SETFL, O_NONBLOCK);
  const std::string self = std::filesystem::read_symlink("/proc/self/exe");
  child_ = spawn_program({self, "--studio", studio.path, flag}, ends[1], STDERR_FILENO);
  if (child_ < 0) throw std::runtime_error(errno_message("cannot run " + self));
}

BusRelay::~BusRelay() {
  pipe_.reset();
  kill_process(child_);
}

void BusRelay::wait(MonotonicInstant deadline) {
  const auto left = std::chrono::ceil<std::chrono::milliseconds>(deadline - Monotonic::now());
  pollfd ready{pipe_.get(), POLLIN, 0};
  poll(&ready, 1, static_cast<int>(std::max<int64_t>(0, left.count())));
  std::array<char, 65536> part{};
  for (int bytes = 0; bytes < kPipeBytes;) {  // bounded: a fast sender must not block the caller
    const ssize_t got = read(pipe_.get(), part.data(), part.size());
    if (got < 0 && errno == EINTR) continue;
    if (got < 0) return;
    if (got == 0) throw BusRelayEnded("the bus relay process has ended");
    reader_.read({part.data(), static_cast<size_t>(got)});
    bytes += static_cast<int>(got);
  }
}

}  // namespace v3d::viewd
