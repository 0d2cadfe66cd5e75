// Events of a schedule in the form of the Promela model (trace.pml).
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <tuple>
#include <vector>

#include "daemon/control/control.h"
#include "wire/messages.h"

namespace v3d::simulation {

/// One event. Fields that its kind does not use are zero.
struct ProtocolEvent {
  /// trace.pml uses the same numbers.
  enum class Kind : uint8_t {
    kCommand,      ///< a node executes a command, repeats its answer, or rejects it
    kReport,       ///< a report of a node's own work changed its phase
    kReply,        ///< a node sends a reply
    kCrash,        ///< a node's process ends
    kPulsesBegin,  ///< pulses of the take that `run` armed
    kPulsesEnd,
    kSend,     ///< an operator sends a new command, or the same one to other nodes
    kReceive,  ///< an operator receives a reply to its present command
  };
  Kind kind{};
  int node = 0;
  int run = 0;  ///< run of v3dctl that sent the command, or the order of kReport and kPulsesBegin
  int64_t counter = 0;
  control::Input command{};
  bool own_only = false;
  int take = 0;            ///< number of the take name in a command; 0: none
  control::Phase phase{};  ///< after the event
  int outcome = 0;         ///< of a reply
  bool may_end = false;    ///< of kReport: a disk is full, or the process shuts down
  uint32_t addressed = 0;  ///< addressed nodes, as bits
  friend bool operator==(const ProtocolEvent&, const ProtocolEvent&) = default;
};

/// Text of an event, such as "node 2 report: recording, run 3, ...".
std::string text_of(const ProtocolEvent& event);

/// All events of one schedule.
struct ProtocolTrace {
  struct Run {
    control::Input order{};  ///< the command of v3dctl
    int take = 0;
  };
  int nodes = 0;  ///< number of nodes; node 0 has the trigger
  std::vector<Run> runs;
  std::vector<ProtocolEvent> events;
};

/// Records the events of a schedule. Replies and pulses of a node's step follow the event of the
/// step. An event equal to the previous one of its kind, node and run is omitted. One thread.
class ProtocolEvents {
 public:
  void add_node(const std::string& node);
  void add_run(const std::string& sender, const wire::CommandMessage& order);

  void on_send(const wire::CommandMessage& command);
  void on_receive(const wire::ReplyMessage& reply);
  void on_command(const std::string& node, const wire::CommandMessage& command,
                  control::Phase after);
  void on_report(const std::string& node, const wire::CommandMessage& order, control::Phase after,
                 bool may_end);
  void on_crash(const std::string& node);
  void on_reply(const wire::ReplyMessage& reply);
  void on_pulses_begin(const wire::CommandMessage& order);
  void on_pulses_end();

  const ProtocolTrace& trace() const { return trace_; }

 private:
  bool is_repeated(const ProtocolEvent& event);
  void add_effects();
  ProtocolEvent event_of(ProtocolEvent::Kind kind, const wire::CommandMessage& command);
  ProtocolEvent event_of(ProtocolEvent::Kind kind, const wire::ReplyMessage& reply);
  int take_number(const std::string& name);

  ProtocolTrace trace_;
  std::vector<ProtocolEvent> effects_;  ///< effects of the current step, not yet in trace_
  std::map<std::string, int> nodes_, runs_, takes_;
  std::map<std::tuple<ProtocolEvent::Kind, int, int>, ProtocolEvent> last_;  ///< by node and run
};

}  // namespace v3d::simulation
