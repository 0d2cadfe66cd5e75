// Sender of events, and the limit on their repetitions.
#pragma once

#include <cstdint>
#include <map>
#include <string>

#include "base/core/time.h"
#include "daemon/bus/bus.h"

namespace v3d::bus {

// Rate limit for events that report a count which changes often.

/// Permits an event for the first count, then when the count has doubled or halved, or has changed
/// and a minute has passed. Each event reports the total, so counts between events are not lost.
/// One thread.
class EventThrottle {
 public:
  static constexpr Duration kAgainAfter = std::chrono::minutes(1);

  /// Returns true when an event for `count`, which is not 0, is due; then `count` counts as
  /// reported.
  bool is_report_due(int64_t count, MonotonicInstant now) {
    const bool is_large_change = count >= 2 * reported_ || 2 * count <= reported_;
    if (count == reported_ || (!is_large_change && now - reported_at_ < kAgainAfter)) return false;
    reported_ = count;
    reported_at_ = now;
    return true;
  }

 private:
  int64_t reported_ = 0;
  MonotonicInstant reported_at_;
};

// Sends events for the operator to the bus and to the log.

/// Events of one node. One thread.
class EventSender {
 public:
  EventSender(Bus& bus, std::string node) : bus_(bus), node_(std::move(node)) {}
  /// Sends one event. `advice`: what the operator can do, appended to the text. Every warning and
  /// alarm needs one.
  void send(wire::Severity severity, const std::string& subject, const std::string& text,
            const std::string& advice = {});
  /// Reports a condition that lasts; to be called repeatedly. Sends an event when `text` differs
  /// from that of the last event for `subject`, and once, as info, when it becomes empty. When only
  /// the first number in the text differs, EventThrottle limits the events.
  void report_condition(wire::Severity severity, const std::string& subject,
                        const std::string& text, const std::string& advice,
                        MonotonicInstant now = Monotonic::now());

 private:
  Bus& bus_;
  const std::string node_;
  int64_t seq_ = 0;
  struct Condition {
    std::string reported;  ///< text of the last event
    EventThrottle number;  ///< the first number in the text
  };
  std::map<std::string, Condition> conditions_;  ///< by subject
};

}  // namespace v3d::bus
