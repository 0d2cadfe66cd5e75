#include "daemon/viewd/web_streams.h"

#include <algorithm>
#include <utility>

#include "codec/frame_header.h"
#include "daemon/viewd/view_json.h"

namespace v3d::viewd {

class LiveFeed::Subscriber : public web::WebStream {
 public:
  /// Gets nothing until the feed has the frame of this number.
  Subscriber(LiveFeed& feed, int64_t waits_for) : feed_(feed), waits_for_(waits_for) {}

  std::optional<web::WebMessage> next() override {
    if (feed_.group_.empty() || feed_.next_number_ <= waits_for_) return {};
    const int64_t key = feed_.group_.front().number;
    const int64_t number = std::max(next_, key);
    const auto at = static_cast<size_t>(number - key);
    if (at >= feed_.group_.size()) return {};
    if (next_ >= 0) feed_.counts_.skipped += number - next_;
    next_ = number + 1;
    return web::WebMessage{.is_text = false, .bytes = feed_.group_[at].message};
  }

 private:
  LiveFeed& feed_;
  const int64_t waits_for_;
  int64_t next_ = -1;  ///< -1: the key frame
};

void LiveFeed::clear_group() {
  group_.clear();
  group_bytes_ = 0;
}

bool LiveFeed::follows(uint32_t reference, int64_t key_pulse) const {
  return !group_.empty() && group_.back().checksum == reference && key_pulse_ == key_pulse &&
         group_.size() < kMaxFrames && group_bytes_ < kMaxBytes;
}

/// A lower pulse number that is sent 5 s later belongs to a new take of the same name.
bool LiveFeed::is_outdated(const wire::MeshMessage& mesh) const {
  constexpr Duration kNewTakeAfter = std::chrono::seconds(5);
  return mesh.take == take_ && mesh.pulse <= pulse_ && mesh.sent - sent_ < kNewTakeAfter;
}

void LiveFeed::add(const wire::MeshMessage& mesh, MonotonicInstant now) {
  ++counts_.frames;
  const auto header = codec::read_header(mesh.compact);
  if (!header) {
    ++counts_.unusable;
    return;
  }
  if (is_outdated(mesh)) {
    ++counts_.outdated;
    return;
  }
  take_ = mesh.take;
  pulse_ = mesh.pulse;
  sent_ = mesh.sent;
  const bool is_key = !header->is(codec::FrameHeader::kInter);
  if (!is_key && !follows(header->reference, header->key_pulse)) {
    // Frames that follow need this one, so drop the group until the next key frame.
    clear_group();
    ++(next_number_ == 0 ? counts_.early : counts_.unusable);
    return;
  }
  if (is_key) clear_group();
  key_pulse_ = header->key_pulse;
  auto message = std::make_shared<const std::string>(mesh_message(mesh, next_number_));
  group_bytes_ += message->size();
  group_.push_back({next_number_++, header->checksum, std::move(message)});
  added_ = now;
}

std::unique_ptr<web::WebStream> LiveFeed::subscribe(MonotonicInstant now) {
  const bool is_live = now - added_ <= kMaxAge;
  return std::make_unique<Subscriber>(*this, is_live ? -1 : next_number_);
}

class StudioStatus::Subscriber : public web::WebStream {
 public:
  explicit Subscriber(const StudioStatus& status) : status_(status) {}

  /// On a slow link, a state or a preview is outdated before it is sent. So reports and events,
  /// which are rare, precede them, and states and previews take turns.
  std::optional<web::WebMessage> next() override {
    const bool is_first = state_ == 0;
    auto message = is_first ? next_state() : std::nullopt;
    if (!message) message = next_report();
    if (!message) message = next_event();
    if (!message && !state_was_last_) message = next_state();
    if (!message) message = next_preview();
    if (!message) message = next_state();
    return message;
  }

 private:
  std::optional<web::WebMessage> next_state() {
    if (status_.state_item_.number <= state_) return {};
    state_ = status_.state_item_.number;
    state_was_last_ = true;
    return web::WebMessage{.is_text = true, .bytes = status_.state_item_.text};
  }

  std::optional<web::WebMessage> next_report() {
    if (status_.report_.number <= report_) return {};
    report_ = status_.report_.number;
    return web::WebMessage{.is_text = true, .bytes = status_.report_.text};
  }

  std::optional<web::WebMessage> next_event() {
    const auto event = std::ranges::upper_bound(status_.events_, event_, {}, &Item::number);
    if (event == status_.events_.end()) return {};
    event_ = event->number;
    return web::WebMessage{.is_text = true, .bytes = event->text};
  }

  /// Of the cameras with a new preview, the one whose last sent preview is the oldest.
  std::optional<web::WebMessage> next_preview() {
    const Item* next = nullptr;
    int64_t* sent = nullptr;
    for (const auto& [camera, preview] : status_.previews_) {
      int64_t& last = previews_[camera];
      if (preview.number <= last || (sent && *sent <= last)) continue;
      next = &preview;
      sent = &last;
    }
    if (!next) return {};
    *sent = next->number;
    state_was_last_ = false;
    return web::WebMessage{.is_text = false, .bytes = next->text};
  }

  const StudioStatus& status_;
  int64_t state_ = 0;
  int64_t report_ = 0;
  int64_t event_ = 0;
  std::map<std::string, int64_t> previews_;  ///< number of the last one that was sent, by camera
  bool state_was_last_ = false;              ///< no preview was sent since
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

void StudioStatus::on_health(const wire::HealthMessage& health, MonotonicInstant now) {
  if (std::ranges::find(state_.nodes, health.node) == state_.nodes.end()) return;
  state_.health[health.node] = health;
  last_health_[health.node] = now;
  changed_ = true;
}

void StudioStatus::on_event(const wire::EventMessage& event) {
  events_.push_back(make_item(event_json(event)));
  if (events_.size() > kEventsKept) events_.pop_front();
}

void StudioStatus::on_preview(const wire::PreviewMessage& preview) {
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
  if (!std::exchange(changed_, false) && now - published_ < kStatePeriod) return;
  published_ = now;
  state_.sent = Realtime::now();
  state_item_ = make_item(state_json(state_));
}

std::unique_ptr<web::WebStream> StudioStatus::subscribe() const {
  return std::make_unique<Subscriber>(*this);
}

}  // namespace v3d::viewd
