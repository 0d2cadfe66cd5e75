#include "daemon/train_watch.h"

#include "wire/channels.h"

namespace v3d {
namespace {

constexpr size_t kHealthQueue = 8;
constexpr Duration kOnItsWay = std::chrono::milliseconds(500);

}  // namespace

TrainWatch::TrainWatch(Bus& bus, const std::string& trigger_node)
    : health_(bus, health_channel(trigger_node), kHealthQueue) {}

void TrainWatch::restart() {
  while (health_.wait(Monotonic::now())) {
  }
  ended_ = false;
  runs_ = false;
  first_.reset();
  newest_ = {};
  commanded_ = 0;
}

void TrainWatch::listen(const std::string& take) {
  while (const auto health = health_.wait(Monotonic::now())) hear(*health, take);
}

void TrainWatch::hear(const HealthMessage& health, const std::string& take) {
  // The network reorders.
  if (health.sent <= newest_) return;
  newest_ = health.sent;
  if (!first_) first_ = health.sent;
  const bool ours = health.take == take;
  const bool runs =
      ours && (health.state == NodeState::kArmed || health.state == NodeState::kRecording);
  runs_ = runs_ || runs;
  // Before it was heard to run, word from before it was armed may still be on its way.
  const bool counts = runs_ || health.sent - *first_ > kOnItsWay;
  ended_ = ended_ || (!runs && counts);
  const auto commanded = health.values.find("pulses_commanded");
  // Anybody may send: a number that no train has is not believed.
  if (ours && commanded != health.values.end() && commanded->second >= 0 &&
      commanded->second < 1e9) {
    commanded_ = static_cast<int64_t>(commanded->second);
  }
}

}  // namespace v3d
