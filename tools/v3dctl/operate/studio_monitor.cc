#include "v3dctl/operate/studio_monitor.h"

#include "v3dctl/operate/not_verified.h"

namespace v3d::ctl {
namespace {

// Nodes report once a second; a busy one may miss a few.
constexpr Duration kSilentAfter = std::chrono::milliseconds(3500);
constexpr Duration kLook = std::chrono::milliseconds(100);
constexpr size_t kEventsKept = 200;

}  // namespace

StudioWatcher::StudioWatcher(const Studio& studio) : client_(studio) {
  tell_if_not_verified(client_);
  view_.studio = studio.name;
  view_.nodes = client_.nodes();
  for (const StudioCamera& camera : studio.cameras) {
    view_.cameras[camera.node].push_back(camera.name);
  }
}

std::vector<EventMessage> StudioWatcher::listen() {
  MonotonicInstant until = Monotonic::now() + kLook;
  while (const auto health = client_.next_health(until)) {
    view_.health[health->node] = *health;
    heard_[health->node] = until = Monotonic::now();
  }
  std::vector<EventMessage> events;
  while (auto event = client_.next_event(Monotonic::now())) {
    view_.events.push_back(*event);
    if (view_.events.size() > kEventsKept) view_.events.pop_front();
    events.push_back(std::move(*event));
  }
  forget_the_silent();
  return events;
}

void StudioWatcher::forget_the_silent() {
  for (const auto& [node, at] : heard_) {
    if (Monotonic::now() - at > kSilentAfter) view_.health.erase(node);
  }
}

}  // namespace v3d::ctl
