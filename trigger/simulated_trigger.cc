#include "trigger/simulated_trigger.h"

#include <poll.h>
#include <sys/socket.h>
#include <sys/un.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstring>
#include <string>
#include <utility>

#include "base/core/error.h"
#include "trigger/paced_train.h"
#include "trigger/pulse_generator.h"

namespace v3d::trigger {
namespace {

/// Edges that are later than this are skipped.
Duration max_lateness(Duration period) {
  return std::min<Duration>(std::chrono::seconds(1), 100 * period);
}

std::string disconnected_text(const std::filesystem::path& path) {
  return "trigger wire " + path.string() + ": connection lost";
}

}  // namespace

SimulatedGenerator::SimulatedGenerator(std::filesystem::path wire, HostClock clock)
    : path_(std::move(wire)), train_(*this, std::move(clock)) {}

SimulatedGenerator::~SimulatedGenerator() = default;

void SimulatedGenerator::arm(const PulseTrain& train) {
  check_train(train, "simulated trigger");
  const Duration period = period_of(train.rate_hz);
  train_.plan({.period = period, .count = train.count, .skip_after = max_lateness(period)});
  cable_.reset();
  cable_ = std::make_unique<TriggerCableClient>(path_);
}

void SimulatedGenerator::start() {
  V3D_CHECK(cable_ && "arm() comes first");
  train_.start();
}

bool SimulatedGenerator::begin_pulse(int64_t /*number*/, MonotonicInstant at) {
  cable_->drain();  // the echo of own edges; the sensor reads its own copy
  return cable_->send({to_ns(at)});
}

std::string SimulatedGenerator::fault() const {
  return train_.output_failed() ? disconnected_text(path_) : train_.fault();
}

SimulatedSensor::SimulatedSensor(std::filesystem::path wire) : path_(std::move(wire)) {}
SimulatedSensor::~SimulatedSensor() = default;

void SimulatedSensor::reset() {
  next_ = 0;
  if (cable_) cable_->drain();
  if (!cable_ || cable_->disconnected()) {
    cable_.reset();
    cable_ = std::make_unique<TriggerCableClient>(path_);
  }
}

std::optional<SensedPulse> SimulatedSensor::wait(MonotonicInstant deadline) {
  if (cable_) {
    if (auto edge = cable_->receive(deadline)) {
      return SensedPulse{next_++, from_ns<Monotonic>(edge->edge_monotonic_ns)};
    }
  }
  sleep_until(deadline);  // so that the caller does not spin after a disconnection
  return {};
}

std::string SimulatedSensor::fault() const {
  if (!cable_) return "trigger wire " + path_.string() + " is not connected";
  return cable_->disconnected() ? disconnected_text(path_) : std::string();
}

TriggerCableClient::TriggerCableClient(const std::filesystem::path& path) {
  const std::string name = path.string();
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  if (name.empty() || name.size() >= sizeof(address.sun_path)) {
    throw InputError("trigger wire '" + name + "': a socket path has 1 to " +
                     std::to_string(sizeof(address.sun_path) - 1) + " characters");
  }
  std::memcpy(address.sun_path, name.data(), name.size());
  fd_.reset(socket(AF_UNIX, SOCK_SEQPACKET | SOCK_CLOEXEC | SOCK_NONBLOCK, 0));
  if (!fd_ || connect(fd_.get(), reinterpret_cast<sockaddr*>(&address), sizeof(address)) != 0) {
    throw InputError(errno_message("trigger wire " + name) + "; is the simulated studio running?");
  }
}

bool TriggerCableClient::send(const TriggerEdge& edge) {
  if (!disconnected_ && ::send(fd_.get(), &edge, sizeof(edge), MSG_NOSIGNAL) != sizeof(edge)) {
    disconnected_ = true;
  }
  return !disconnected_;
}

std::optional<TriggerEdge> TriggerCableClient::receive_now() {
  TriggerEdge edge;
  const ssize_t n = recv(fd_.get(), &edge, sizeof(edge), MSG_TRUNC);
  if (n == sizeof(edge)) return edge;
  // End of file, errors and packets of another size mean that the cable cannot be used.
  const bool nothing_there = n < 0 && (errno == EAGAIN || errno == EINTR);
  disconnected_ = disconnected_ || !nothing_there;
  return {};
}

std::optional<TriggerEdge> TriggerCableClient::receive(MonotonicInstant deadline) {
  while (!disconnected_) {
    if (auto edge = receive_now()) return edge;
    const Duration left = deadline - Monotonic::now();
    if (disconnected_ || left <= Duration::zero()) break;
    const timespec timeout = to_timespec(left);
    pollfd readable{fd_.get(), POLLIN, 0};
    ppoll(&readable, 1, &timeout, nullptr);
  }
  return {};
}

void TriggerCableClient::drain() {
  while (receive_now()) {
  }
}

}  // namespace v3d::trigger
