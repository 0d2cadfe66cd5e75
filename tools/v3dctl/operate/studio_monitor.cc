#include "v3dctl/operate/studio_monitor.h"

#include <algorithm>
#include <utility>

#include "common/console.h"
#include "v3dctl/operate/health_text.h"

namespace v3d::ctl {
namespace {

// Nodes report once a second; a busy node may skip some reports.
constexpr Duration kSilentAfter = std::chrono::milliseconds(3500);
constexpr Duration kPollWait = std::chrono::milliseconds(100);
constexpr size_t kMaxEvents = 200;

}  // namespace

StudioMonitor::StudioMonitor(const Studio& studio) : client_(studio) {
  report_if_not_verified(client_);
  state_.studio = studio.name;
  state_.nodes = client_.nodes();
  for (const StudioCamera& camera : studio.cameras) {
    state_.cameras[camera.node].push_back(camera.name);
  }
}

std::vector<wire::EventMessage> StudioMonitor::poll() {
  MonotonicInstant until = Monotonic::now() + kPollWait;
  while (const auto health = client_.next_health(until)) {
    state_.health[health->node] = *health;
    received_at_[health->node] = until = Monotonic::now();
  }
  std::vector<wire::EventMessage> events;
  while (auto event = client_.next_event(Monotonic::now())) {
    state_.events.push_back(*event);
    if (state_.events.size() > kMaxEvents) state_.events.pop_front();
    events.push_back(std::move(*event));
  }
  drop_silent_nodes();
  return events;
}

void StudioMonitor::drop_silent_nodes() {
  for (const auto& [node, at] : received_at_) {
    if (Monotonic::now() - at > kSilentAfter) state_.health.erase(node);
  }
}

void report_if_not_verified(const control::OperatorClient& client) {
  if (client.not_verified().empty()) return;
  note("v3dctl: messages are not verified: " + client.not_verified());
}

TakeProgress::TakeProgress(std::vector<std::string> nodes, std::string trigger_node,
                           MonotonicInstant start)
    : trigger_node_(std::move(trigger_node)) {
  for (std::string& node : nodes) nodes_[std::move(node)] = {.last = start, .health = {}};
}

void TakeProgress::on_health(const wire::HealthMessage& health, MonotonicInstant now) {
  const auto node = nodes_.find(health.node);
  if (node != nodes_.end()) node->second = {.last = now, .has_reported = true, .health = health};
}

TakeProgress::State TakeProgress::state(MonotonicInstant now) const {
  if (is_silent(nodes_.at(trigger_node_), now)) return State::kTriggerIsSilent;
  const bool has_ended = std::ranges::all_of(nodes_, [&](const auto& entry) {
    const Node& node = entry.second;
    return is_silent(node, now) || (node.has_reported && !is_in_take(node.health));
  });
  return has_ended ? State::kEnded : State::kRunning;
}

std::map<std::string, wire::HealthMessage> TakeProgress::health(MonotonicInstant now) const {
  std::map<std::string, wire::HealthMessage> health;
  for (const auto& [name, node] : nodes_) {
    if (node.has_reported && !is_silent(node, now)) health[name] = node.health;
  }
  return health;
}

}  // namespace v3d::ctl
