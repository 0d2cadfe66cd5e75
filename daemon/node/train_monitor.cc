#include "daemon/node/train_monitor.h"

#include <algorithm>
#include <utility>

#include "wire/channels.h"
#include "wire/codec.h"

namespace v3d {
namespace {

constexpr size_t kHealthQueue = 8;

/// Empty for an implausible number.
std::optional<int64_t> commanded_by(const HealthMessage& health) {
  const auto commanded = health.values.find("pulses_commanded");
  if (commanded == health.values.end()) return std::nullopt;
  if (!(commanded->second >= 0 && commanded->second < 1e9)) return std::nullopt;
  return static_cast<int64_t>(commanded->second);
}

std::optional<ReceivedHealth> open_health(const ReceivedMessage& in) {
  if (!in.is_accepted) return std::nullopt;
  auto health = decode<HealthMessage>(in.bytes);
  if (!health || in.channel != health_channel(health->node)) return std::nullopt;
  return ReceivedHealth{
      .health = *std::move(health), .session = in.session, .received = Monotonic::now()};
}

}  // namespace

bool HealthOrder::is_newest(const ReceivedHealth& message) {
  if (std::ranges::find(former_, message.session) != former_.end()) return false;
  if (session_ == message.session) {
    if (message.health.seq <= seq_) return false;
  } else if (session_) {
    if (former_.size() == kMaxFormer) former_.pop_front();
    former_.push_back(*session_);
  }
  session_ = message.session;
  seq_ = message.health.seq;
  return true;
}

void TrainState::reset(MonotonicInstant now) {
  began_ = now;
  ended_ = was_running_ = false;
  commanded_ = 0;
}

std::optional<TrainState::RunningTake> TrainState::running(const ReceivedHealth& message) {
  if (!order_.is_newest(message)) return std::nullopt;
  const HealthMessage& health = message.health;
  const bool records = health.state == NodeState::kRecording;
  was_running_ = records;
  return RunningTake{.take = records ? health.take : "",
                     .commanded = commanded_by(health).value_or(0)};
}

void TrainState::on_health(const ReceivedHealth& message, const std::string& take) {
  if (!order_.is_newest(message)) return;
  const HealthMessage& health = message.health;
  const bool ours = health.take == take;
  const bool is_running =
      ours && (health.state == NodeState::kArmed || health.state == NodeState::kRecording);
  was_running_ = was_running_ || is_running;
  // Until the node is known to run, messages from before it was armed may still be in flight.
  const bool is_current = was_running_ || message.received - began_ > kMaxAge;
  ended_ = ended_ || (!is_running && is_current);
  if (ours) commanded_ = commanded_by(health).value_or(commanded_);
}

TrainMonitor::TrainMonitor(Bus& bus, const std::string& trigger_node)
    : health_(bus, health_channel(trigger_node), kHealthQueue, open_health) {}

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

}  // namespace v3d
