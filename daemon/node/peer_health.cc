#include "daemon/node/peer_health.h"

#include <algorithm>
#include <utility>

#include "wire/codec.h"

namespace v3d::node {
namespace {

constexpr size_t kHealthQueue = 8;

/// Empty for an implausible number.
std::optional<int64_t> commanded_by(const wire::HealthMessage& health) {
  const auto commanded = health.values.find("pulses_commanded");
  if (commanded == health.values.end()) return std::nullopt;
  if (!(commanded->second >= 0 && commanded->second < 1e9)) return std::nullopt;
  return static_cast<int64_t>(commanded->second);
}

bool is_set(const wire::HealthMessage& health, const char* flag) {
  const auto found = health.values.find(flag);
  return found != health.values.end() && found->second > 0;
}

std::optional<ReceivedHealth> open_health(const bus::ReceivedMessage& in) {
  if (!in.is_accepted) return std::nullopt;
  auto health = wire::decode<wire::HealthMessage>(in.bytes);
  if (!health || in.channel != wire::health_channel(health->node)) return std::nullopt;
  const MonotonicInstant now = Monotonic::now();
  return ReceivedHealth{
      .health = *std::move(health), .session = in.session, .received = now, .sent = now - in.age};
}

}  // namespace

bool HealthOrder::is_newest(const ReceivedHealth& message) {
  if (std::ranges::find(former_, message.session) != former_.end()) return false;
  if (session_ == message.session) {
    if (message.health.seq <= seq_) return false;
  } else if (session_) {
    if (!has_ended_ && message.sent - sent_ < kSilence) return false;
    if (former_.size() == kMaxFormer) former_.pop_front();
    former_.push_back(*session_);
  }
  session_ = message.session;
  seq_ = message.health.seq;
  sent_ = message.sent;
  has_ended_ = is_set(message.health, kStopping);
  return true;
}

void TrainState::reset(MonotonicInstant now) {
  began_ = now;
  ended_ = was_running_ = false;
  commanded_ = 0;
}

std::optional<TrainState::RunningTake> TrainState::running(const ReceivedHealth& message) {
  if (!order_.is_newest(message)) return std::nullopt;
  const wire::HealthMessage& health = message.health;
  const bool records = health.state == wire::NodeState::kRecording;
  was_running_ = records;
  return RunningTake{.take = records ? health.take : "",
                     .commanded = commanded_by(health).value_or(0)};
}

void TrainState::on_health(const ReceivedHealth& message, const std::string& take) {
  if (!order_.is_newest(message)) return;
  const wire::HealthMessage& health = message.health;
  const bool ours = health.take == take;
  const bool is_running = ours && (health.state == wire::NodeState::kArmed ||
                                   health.state == wire::NodeState::kRecording);
  was_running_ = was_running_ || is_running;
  // Until the node is known to run, messages from before it was armed may still be in flight.
  const bool is_current = was_running_ || message.received - began_ > kMaxHealthAge;
  ended_ = ended_ || (!is_running && is_current);
  if (ours) commanded_ = commanded_by(health).value_or(commanded_);
}

TrainMonitor::TrainMonitor(bus::Bus& bus, const std::string& trigger_node)
    : health_(bus, wire::health_channel(trigger_node), kHealthQueue, open_health) {}

void TrainMonitor::reset() {
  while (const auto health = health_.wait(Monotonic::now())) train_.note(*health);
  train_.reset(Monotonic::now());
}

void TrainMonitor::poll(const std::string& take) {
  while (const auto health = health_.wait(Monotonic::now())) train_.on_health(*health, take);
}

std::optional<TrainMonitor::RunningTake> TrainMonitor::running() {
  std::optional<RunningTake> running;
  while (const auto health = health_.wait(Monotonic::now())) {
    if (auto newer = train_.running(*health)) running = std::move(newer);
  }
  return running;
}

bool reports_full_disk(const wire::HealthMessage& health) { return is_set(health, kDiskFull); }

void FullDiskState::reset(MonotonicInstant now) {
  began_ = now;
  has_joined_ = is_full_ = false;
}

void FullDiskState::on_health(const ReceivedHealth& message, const std::string& take) {
  if (!order_.is_newest(message)) return;
  has_joined_ = has_joined_ || message.health.take == take;
  // Until the node has joined, messages from before it was armed may still be in flight.
  const bool is_current = has_joined_ || message.received - began_ > kMaxHealthAge;
  is_full_ = is_full_ || (is_current && reports_full_disk(message.health));
}

DiskMonitor::DiskMonitor(bus::Bus& bus, const std::vector<std::string>& nodes) {
  for (const std::string& node : nodes) {
    nodes_.push_back({.name = node,
                      .health = std::make_unique<bus::Subscription<ReceivedHealth>>(
                          bus, wire::health_channel(node), kHealthQueue, open_health),
                      .disk = {}});
  }
}

void DiskMonitor::reset() {
  for (Node& node : nodes_) {
    while (const auto health = node.health->wait(Monotonic::now())) node.disk.note(*health);
    node.disk.reset(Monotonic::now());
  }
}

std::string DiskMonitor::full_node(const std::string& take) {
  for (Node& node : nodes_) {
    while (const auto health = node.health->wait(Monotonic::now())) {
      node.disk.on_health(*health, take);
    }
    if (node.disk.is_full()) return node.name;
  }
  return "";
}

}  // namespace v3d::node
