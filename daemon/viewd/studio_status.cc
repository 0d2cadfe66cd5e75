#include "daemon/viewd/studio_status.h"

#include <algorithm>
#include <utility>

namespace v3d {

class StudioStatus::Subscriber : public WebStream {
 public:
  explicit Subscriber(const StudioStatus& status) : status_(status) {}

  std::optional<WebMessage> next() override {
    if (status_.state_item_.number > state_) {
      state_ = status_.state_item_.number;
      return WebMessage{.is_text = true, .bytes = status_.state_item_.text};
    }
    if (status_.report_.number > report_) {
      report_ = status_.report_.number;
      return WebMessage{.is_text = true, .bytes = status_.report_.text};
    }
    for (const Item& event : status_.events_) {
      if (event.number <= event_) continue;
      event_ = event.number;
      return WebMessage{.is_text = true, .bytes = event.text};
    }
    for (const auto& [camera, preview] : status_.previews_) {
      int64_t& last = previews_[camera];
      if (preview.number <= last) continue;
      last = preview.number;
      return WebMessage{.is_text = false, .bytes = preview.text};
    }
    return {};
  }

 private:
  const StudioStatus& status_;
  int64_t state_ = 0;
  int64_t report_ = 0;
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

StudioStatus::Item StudioStatus::make_item(std::string text) {
  return {++last_number_, std::make_shared<const std::string>(std::move(text))};
}

void StudioStatus::on_health(const HealthMessage& health, MonotonicInstant now) {
  if (std::ranges::find(state_.nodes, health.node) == state_.nodes.end()) return;
  state_.health[health.node] = health;
  last_health_[health.node] = now;
  changed_ = true;
}

void StudioStatus::on_event(const EventMessage& event) {
  events_.push_back(make_item(event_json(event)));
  if (events_.size() > kEventsKept) events_.pop_front();
}

void StudioStatus::on_preview(const PreviewMessage& preview) {
  const auto found = previews_.find(preview.camera);
  if (found != previews_.end()) found->second = make_item(preview_message(preview));
}

void StudioStatus::set_not_verified(std::string why) {
  changed_ = changed_ || why != state_.not_verified;
  state_.not_verified = std::move(why);
}

void StudioStatus::set_subscriber_count(int64_t count) {
  changed_ = changed_ || count != state_.watchers;
  state_.watchers = count;
}

void StudioStatus::set_control(bool accepts_commands) {
  changed_ = changed_ || accepts_commands != state_.control;
  state_.control = accepts_commands;
}

void StudioStatus::set_report(const CommandReport& report) {
  const bool same = report.number == report_number_ && report.is_running == report_running_;
  if (same) return;
  report_number_ = report.number;
  report_running_ = report.is_running;
  report_ = make_item(report_json(report));
}

void StudioStatus::refresh(MonotonicInstant now) {
  for (const auto& [node, at] : last_health_) {
    if (now - at > kSilenceTimeout && state_.health.erase(node) > 0) changed_ = true;
  }
  if (!std::exchange(changed_, false)) return;
  state_item_ = make_item(state_json(state_));
}

std::unique_ptr<WebStream> StudioStatus::subscribe() const {
  return std::make_unique<Subscriber>(*this);
}

}  // namespace v3d
