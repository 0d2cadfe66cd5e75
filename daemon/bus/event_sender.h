// Sends events for the operator to the bus and to the log.
#pragma once

#include <map>
#include <string>

#include "daemon/bus/bus.h"
#include "daemon/bus/event_throttle.h"

namespace v3d {

/// Events of one node. One thread.
class EventSender {
 public:
  EventSender(Bus& bus, std::string node) : bus_(bus), node_(std::move(node)) {}
  /// Sends one event. `advice`: what the operator can do, appended to the text. Every warning and
  /// alarm needs one.
  void send(Severity severity, const std::string& subject, const std::string& text,
            const std::string& advice = {});
  /// Reports a condition that lasts; to be called repeatedly. Sends an event when `text` differs
  /// from the previous call for `subject`, and once, as info, when it becomes empty. When only the
  /// first number in the text differs, EventThrottle limits the events.
  void report_condition(Severity severity, const std::string& subject, const std::string& text,
                        const std::string& advice, MonotonicInstant now = Monotonic::now());

 private:
  Bus& bus_;
  const std::string node_;
  int64_t seq_ = 0;
  struct Condition {
    std::string text;
    EventThrottle number;  ///< the first number in the text
  };
  std::map<std::string, Condition> conditions_;  ///< by subject
};

}  // namespace v3d
