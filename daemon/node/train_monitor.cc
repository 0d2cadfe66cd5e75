#include "daemon/node/train_monitor.h"

#include "wire/channels.h"

namespace v3d {
namespace {

constexpr size_t kHealthQueue = 8;
constexpr Duration kOvertakenBy = std::chrono::seconds(10);
constexpr Duration kOnItsWay = std::chrono::milliseconds(500);

/// A number that no train has is not believed.
std::optional<int64_t> commanded_by(const HealthMessage& health) {
  const auto commanded = health.values.find("pulses_commanded");
  if (commanded == health.values.end()) return std::nullopt;
  if (!(commanded->second >= 0 && commanded->second < 1e9)) return std::nullopt;
  return static_cast<int64_t>(commanded->second);
}

}  // namespace

/// The network reorders, by less than kOvertakenBy. What seems older is of a clock that was set.
bool TrainState::is_news(const HealthMessage& health) {
  if (health.sent <= newest_ && newest_ - health.sent < kOvertakenBy) return false;
  newest_ = health.sent;
  return true;
}

std::optional<TrainState::Running> TrainState::running(const HealthMessage& health) {
  if (!is_news(health)) return std::nullopt;
  const bool records = health.state == NodeState::kRecording;
  return Running{.take = records ? health.take : "", .commanded = commanded_by(health).value_or(0)};
}

void TrainState::on_health(const HealthMessage& health, const std::string& take) {
  if (!is_news(health)) return;
  if (!first_) first_ = health.sent;
  const bool ours = health.take == take;
  const bool runs =
      ours && (health.state == NodeState::kArmed || health.state == NodeState::kRecording);
  runs_ = runs_ || runs;
  // Before it was heard to run, word from before it was armed may still be on its way.
  const bool counts = runs_ || std::chrono::abs(health.sent - *first_) > kOnItsWay;
  ended_ = ended_ || (!runs && counts);
  if (ours) commanded_ = commanded_by(health).value_or(commanded_);
}

TrainMonitor::TrainMonitor(Bus& bus, const std::string& trigger_node)
    : health_(bus, health_channel(trigger_node), kHealthQueue) {}

void TrainMonitor::restart() {
  while (health_.wait(Monotonic::now())) {
  }
  train_.restart();
}

void TrainMonitor::listen(const std::string& take) {
  while (const auto health = health_.wait(Monotonic::now())) train_.on_health(*health, take);
}

std::optional<TrainMonitor::Running> TrainMonitor::running() {
  std::optional<Running> running;
  while (const auto health = health_.wait(Monotonic::now())) {
    if (auto news = train_.running(*health)) running = std::move(news);
  }
  return running;
}

}  // namespace v3d
