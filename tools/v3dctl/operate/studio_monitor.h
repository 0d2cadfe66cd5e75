// Current state of a studio: health of its nodes and recent events from the bus, the progress of a
// take, and the table of `v3dctl watch`.
#pragma once

#include <cstdint>
#include <deque>
#include <map>
#include <string>
#include <vector>

#include "base/config/studio_file.h"
#include "base/core/time.h"
#include "daemon/control/operator_client.h"
#include "wire/messages.h"

namespace v3d::ctl {

struct StudioSnapshot {
  std::string studio;
  std::vector<std::string> nodes;                           ///< in the order of the studio file
  std::map<std::string, std::vector<std::string>> cameras;  ///< names by node
  std::map<std::string, wire::HealthMessage> health;  ///< last of each node; silent nodes have none
  std::deque<wire::EventMessage> events;              ///< newest last
};

/// Receives health and events. One thread.
class StudioMonitor {
 public:
  /// Joins the network of the studio. Throws InputError when that fails.
  explicit StudioMonitor(const Studio& studio);

  /// Updates state() with the messages since the last call, and waits at most 100 ms for one.
  /// Returns the new events.
  std::vector<wire::EventMessage> poll();
  const StudioSnapshot& state() const { return state_; }

 private:
  void drop_silent_nodes();

  control::OperatorClient client_;
  StudioSnapshot state_;
  std::map<std::string, MonotonicInstant> received_at_;  ///< of the last health, by node
};

/// Reports on stderr that messages are not verified, where the client has no studio key.
void report_if_not_verified(const control::OperatorClient& client);

// Detects the end of a take on all nodes from their health messages.

/// Follows a take that was started. States of nodes decide, because counts of pulses cannot: a
/// pulse may have been lost. No input or output. One thread.
class TakeProgress {
 public:
  /// Health comes every second. A busy node may skip some messages; without one for this long, it
  /// is silent.
  static constexpr Duration kSilentAfter = std::chrono::seconds(15);

  /// `nodes`: all that record or reconstruct the take. `start`: the time from which they have sent
  /// health.
  TakeProgress(std::vector<std::string> nodes, std::string trigger_node, MonotonicInstant start);

  void on_health(const wire::HealthMessage& health, MonotonicInstant now);

  enum class State : uint8_t {
    kRunning,
    kEnded,            ///< no node is in a take, except silent nodes
    kTriggerIsSilent,  ///< whether pulses run is unknown
  };
  State state(MonotonicInstant now) const;

  /// The last health of each node that is not silent.
  std::map<std::string, wire::HealthMessage> health(MonotonicInstant now) const;

 private:
  struct Node {
    MonotonicInstant last;  ///< time of the last health
    bool has_reported = false;
    wire::HealthMessage health;
  };
  static bool is_silent(const Node& node, MonotonicInstant now) {
    return now - node.last > kSilentAfter;
  }

  const std::string trigger_node_;
  std::map<std::string, Node> nodes_;
};

// Table of `v3dctl watch`: the state of a studio as coloured lines. Pure, except for the time zone:
// watch_table.cc

/// Urgency of a value, shown as a colour.
enum class Highlight { kNone, kWarning, kAlarm };

struct WatchLine {
  struct Part {
    std::string text;
    Highlight highlight = Highlight::kNone;
  };
  std::vector<Part> parts;

  /// `colours`: with the escape sequences of a terminal.
  std::string text(bool colours) const;
};

/// Summary, then a line for each node with its cameras below, then the last events. The result has
/// at most `height` lines of at most `width` columns: events are dropped first, then cameras
/// without a fault.
std::vector<WatchLine> watch_lines(const StudioSnapshot& state, size_t width, size_t height);

/// "14:03:11  cap01  cam07: lost ...", local time.
WatchLine event_line(const wire::EventMessage& event);

/// State and progress of the take: "recording kendo-07   300 pulses   15/15 cameras ...".
std::string summary_line(const StudioSnapshot& state);

}  // namespace v3d::ctl
