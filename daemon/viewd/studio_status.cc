#include "daemon/viewd/studio_status.h"

#include <algorithm>
#include <utility>

namespace v3d {

class StudioStatus::Watcher : public WebStream {
 public:
  explicit Watcher(const StudioStatus& board) : board_(board) {}

  std::optional<WebMessage> next() override {
    if (board_.shown_.number > state_) {
      state_ = board_.shown_.number;
      return WebMessage{.is_text = true, .bytes = board_.shown_.text};
    }
    if (board_.order_.number > order_) {
      order_ = board_.order_.number;
      return WebMessage{.is_text = true, .bytes = board_.order_.text};
    }
    for (const Note& event : board_.events_) {
      if (event.number <= event_) continue;
      event_ = event.number;
      return WebMessage{.is_text = true, .bytes = event.text};
    }
    for (const auto& [camera, preview] : board_.previews_) {
      int64_t& last = previews_[camera];
      if (preview.number <= last) continue;
      last = preview.number;
      return WebMessage{.is_text = false, .bytes = preview.text};
    }
    return {};
  }

 private:
  const StudioStatus& board_;
  int64_t state_ = 0;
  int64_t order_ = 0;
  int64_t event_ = 0;
  std::map<std::string, int64_t> previews_;
};

StudioStatus::StudioStatus(const Studio& studio, const std::vector<std::string>& nodes,
                           std::string not_verified) {
  state_.studio = studio.name;
  state_.not_verified = std::move(not_verified);
  state_.nodes = nodes;
  for (const StudioCamera& camera : studio.cameras) {
    state_.cameras[camera.node].push_back(camera.name);
    previews_[camera.name] = {};
  }
}

StudioStatus::Note StudioStatus::note(std::string text) {
  return {++numbers_, std::make_shared<const std::string>(std::move(text))};
}

void StudioStatus::hear(const HealthMessage& health, MonotonicInstant now) {
  if (std::ranges::find(state_.nodes, health.node) == state_.nodes.end()) return;
  state_.health[health.node] = health;
  heard_[health.node] = now;
  changed_ = true;
}

void StudioStatus::hear(const EventMessage& event) {
  events_.push_back(note(event_json(event)));
  if (events_.size() > kEventsKept) events_.pop_front();
}

void StudioStatus::hear(const PreviewMessage& preview) {
  const auto found = previews_.find(preview.camera);
  if (found != previews_.end()) found->second = note(preview_message(preview));
}

void StudioStatus::set_not_verified(std::string why) {
  changed_ = changed_ || why != state_.not_verified;
  state_.not_verified = std::move(why);
}

void StudioStatus::set_watchers(int64_t watchers) {
  changed_ = changed_ || watchers != state_.watchers;
  state_.watchers = watchers;
}

void StudioStatus::set_control(bool takes_orders) {
  changed_ = changed_ || takes_orders != state_.control;
  state_.control = takes_orders;
}

void StudioStatus::set_order(const CommandReport& order) {
  const bool same = order.number == order_number_ && order.under_way == order_under_way_;
  if (same) return;
  order_number_ = order.number;
  order_under_way_ = order.under_way;
  order_ = note(order_json(order));
}

void StudioStatus::turn(MonotonicInstant now) {
  for (const auto& [node, at] : heard_) {
    if (now - at > kSilentAfter && state_.health.erase(node) > 0) changed_ = true;
  }
  if (!std::exchange(changed_, false)) return;
  shown_ = note(state_json(state_));
}

std::unique_ptr<WebStream> StudioStatus::watch() const { return std::make_unique<Watcher>(*this); }

}  // namespace v3d
