#include "v3dctl/operate/studio_monitor.h"

#include "common/console.h"

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

}  // namespace v3d::ctl
