#include "daemon/train_watch.h"

#include "wire/channels.h"

namespace v3d {
namespace {

constexpr size_t kHealthQueue = 8;

}  // namespace

TrainWatch::TrainWatch(Bus& bus, const std::string& trigger_node)
    : health_(bus, health_channel(trigger_node), kHealthQueue) {}

void TrainWatch::restart() {
  while (health_.wait(Monotonic::now())) {
  }
  ended_ = false;
  commanded_ = 0;
}

void TrainWatch::listen(const std::string& take) {
  while (const auto health = health_.wait(Monotonic::now())) hear(*health, take);
}

void TrainWatch::hear(const HealthMessage& health, const std::string& take) {
  const bool ours = health.take == take;
  const bool runs = health.state == NodeState::kArmed || health.state == NodeState::kRecording;
  ended_ = ended_ || !(ours && runs);
  const auto commanded = health.values.find("pulses_commanded");
  // Anybody may send: a number that no train has is not believed.
  if (ours && commanded != health.values.end() && commanded->second >= 0 &&
      commanded->second < 1e9) {
    commanded_ = static_cast<int64_t>(commanded->second);
  }
}

}  // namespace v3d
