#include "daemon/node/train_monitor.h"

#include "wire/channels.h"

namespace v3d {
namespace {

constexpr size_t kHealthQueue = 8;
/// The network reorders messages by less than this. A message that seems older was sent after the
/// clock of the trigger's node was set back.
constexpr Duration kMaxReordering = std::chrono::seconds(10);
/// A message is in flight for less than this.
constexpr Duration kMaxInFlight = std::chrono::milliseconds(500);

/// Empty for an implausible number.
std::optional<int64_t> commanded_by(const HealthMessage& health) {
  const auto commanded = health.values.find("pulses_commanded");
  if (commanded == health.values.end()) return std::nullopt;
  if (!(commanded->second >= 0 && commanded->second < 1e9)) return std::nullopt;
  return static_cast<int64_t>(commanded->second);
}

}  // namespace

bool TrainState::is_newer(const HealthMessage& health) {
  if (health.sent <= newest_sent_ && newest_sent_ - health.sent < kMaxReordering) return false;
  newest_sent_ = health.sent;
  return true;
}

std::optional<TrainState::RunningTake> TrainState::running(const HealthMessage& health) {
  if (!is_newer(health)) return std::nullopt;
  const bool records = health.state == NodeState::kRecording;
  return RunningTake{.take = records ? health.take : "",
                     .commanded = commanded_by(health).value_or(0)};
}

void TrainState::on_health(const HealthMessage& health, const std::string& take) {
  if (!is_newer(health)) return;
  if (!first_sent_) first_sent_ = health.sent;
  const bool ours = health.take == take;
  const bool is_running =
      ours && (health.state == NodeState::kArmed || health.state == NodeState::kRecording);
  was_running_ = was_running_ || is_running;
  // Until the node is known to run, messages from before it was armed may still be in flight.
  const bool is_current =
      was_running_ || std::chrono::abs(health.sent - *first_sent_) > kMaxInFlight;
  ended_ = ended_ || (!is_running && is_current);
  if (ours) commanded_ = commanded_by(health).value_or(commanded_);
}

TrainMonitor::TrainMonitor(Bus& bus, const std::string& trigger_node)
    : health_(bus, health_channel(trigger_node), kHealthQueue) {}

void TrainMonitor::reset() {
  while (health_.wait(Monotonic::now())) {
  }
  train_.reset();
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
