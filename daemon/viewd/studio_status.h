// The current state of the studio for WebSocket clients: health, previews, events, last command.
#pragma once

#include <cstdint>
#include <deque>
#include <map>
#include <memory>
#include <optional>
#include <string>

#include "base/config/studio_file.h"
#include "base/core/time.h"
#include "daemon/viewd/operator_command.h"
#include "daemon/viewd/view_json.h"
#include "daemon/web/web_message.h"

namespace v3d {

/// Holds only the last state, the last preview of each camera, and the last events. So a slow
/// client gets the newest of each, and memory is bounded. One thread.
class StudioStatus {
 public:
  static constexpr size_t kEventsKept = 100;
  /// After this time without health a node counts as silent. Nodes send it once a second.
  static constexpr Duration kSilenceTimeout = std::chrono::milliseconds(3500);

  /// `nodes`: the nodes to show. `not_verified`: see OperatorClient.
  StudioStatus(const Studio& studio, const std::vector<std::string>& nodes,
               std::string not_verified);

  /// Messages of nodes and cameras that the studio file does not name are ignored.
  void on_health(const HealthMessage& health, MonotonicInstant now);
  void on_event(const EventMessage& event);
  void on_preview(const PreviewMessage& preview);
  void set_not_verified(std::string why);
  void set_subscriber_count(int64_t count);
  void set_control(bool accepts_commands);
  /// The last command; number 0: there was none.
  void set_report(const CommandReport& report);
  /// Removes silent nodes, and publishes the state if it has changed.
  void refresh(MonotonicInstant now);

  /// A subscriber that starts with the current state. The StudioStatus must outlive it.
  std::unique_ptr<WebStream> subscribe() const;

 private:
  class Subscriber;
  struct Item {
    int64_t number = 0;  ///< ascends over all items
    std::shared_ptr<const std::string> text;
  };
  Item make_item(std::string text);

  StudioState state_;
  std::map<std::string, MonotonicInstant> last_health_;  ///< by node
  bool changed_ = true;
  int64_t last_number_ = 0;
  Item state_item_;
  Item report_;
  int64_t report_number_ = 0;
  bool report_running_ = false;
  std::deque<Item> events_;
  std::map<std::string, Item> previews_;  ///< by camera
};

}  // namespace v3d
