// Events for the operator: on the bus and in the log.
#pragma once

#include <map>
#include <string>

#include "daemon/bus/bus.h"
#include "daemon/bus/event_throttle.h"

namespace v3d {

/// One thread.
class EventSender {
 public:
  EventSender(Bus& bus, std::string node) : bus_(bus), node_(std::move(node)) {}
  /// `advice`: what the operator can do, said after the text; of every warning and alarm.
  void send(Severity severity, const std::string& subject, const std::string& text,
            const std::string& advice = {});
  /// For a trouble that lasts: sends when `text` is another than last time, and once, as info, when
  /// it has become empty. EventThrottle decides when a text is sent again of which only the first
  /// number has changed.
  void keep_told(Severity severity, const std::string& subject, const std::string& text,
                 const std::string& advice, MonotonicInstant now = Monotonic::now());

 private:
  Bus& bus_;
  const std::string node_;
  int64_t seq_ = 0;
  struct Told {
    std::string text;
    EventThrottle number;  ///< in the text
  };
  std::map<std::string, Told> told_;  ///< troubles by subject
};

}  // namespace v3d
