// What the studio shows of itself now: health, previews, events; for all who watch.
#pragma once

#include <cstdint>
#include <deque>
#include <map>
#include <memory>
#include <optional>
#include <string>

#include "base/studio_file.h"
#include "base/time.h"
#include "daemon/viewd/operator_command.h"
#include "daemon/viewd/view_json.h"
#include "daemon/viewd/web_message.h"

namespace v3d {

/// Holds the last state, the last preview of every camera and the last events, and no more: who is
/// slow is sent the newest of each, and misses what was between. One thread.
class StudioStatus {
 public:
  static constexpr size_t kEventsKept = 100;
  /// Nodes tell their health once a second; a busy one may miss a few.
  static constexpr Duration kSilentAfter = std::chrono::milliseconds(3500);

  /// `nodes`: those that should be heard; `not_verified` as OperatorClient tells.
  StudioStatus(const Studio& studio, const std::vector<std::string>& nodes,
               std::string not_verified);

  /// Of nodes and cameras that the studio file does not name nothing is kept.
  void hear(const HealthMessage& health, MonotonicInstant now);
  void hear(const EventMessage& event);
  void hear(const PreviewMessage& preview);
  void set_not_verified(std::string why);
  void set_watchers(int64_t watchers);
  void set_control(bool takes_orders);
  /// The last order; number 0: there was none.
  void set_order(const CommandReport& order);
  /// Forgets who has fallen silent, and makes the state known when it has changed.
  void turn(MonotonicInstant now);

  /// One who watches, from what there is now on. The board outlives it.
  std::unique_ptr<WebStream> watch() const;

 private:
  class Watcher;
  struct Note {
    int64_t number = 0;  ///< rises with each that is pinned up
    std::shared_ptr<const std::string> text;
  };
  Note note(std::string text);

  StudioState state_;
  std::map<std::string, MonotonicInstant> heard_;  ///< when, by node
  bool changed_ = true;
  int64_t numbers_ = 0;
  Note shown_;
  Note order_;
  int64_t order_number_ = 0;
  bool order_under_way_ = false;
  std::deque<Note> events_;
  std::map<std::string, Note> previews_;  ///< by camera
};

}  // namespace v3d
