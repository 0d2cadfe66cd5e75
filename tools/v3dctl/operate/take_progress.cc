#include "v3dctl/operate/take_progress.h"

#include <algorithm>
#include <utility>

#include "v3dctl/operate/health_text.h"

namespace v3d::ctl {

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
