// The events of a schedule as the Promela model knows them (trace.pml).
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <tuple>
#include <vector>

#include "daemon/control/control_table.h"
#include "wire/messages.h"

namespace v3d::simulation {

struct ProtocolEvent {
  /// trace.pml has the same numbers.
  enum class Kind : uint8_t {
    kCommand,      ///< a node obeys a command, answers it again, or refuses it
    kReport,       ///< a node's own work has changed its phase
    kReply,        ///< a node sends a reply
    kCrash,        ///< a node's process ends
    kPulsesBegin,  ///< of the take that `run` armed
    kPulsesEnd,
    kSend,  ///< an operator sends a command, for the first time or to other nodes
    kHear,  ///< an operator receives a reply to its present command
  };
  Kind kind{};
  int node = 0;
  int run = 0;  ///< of v3dctl: the sender; of kReport and kPulsesBegin: of the order
  int64_t counter = 0;
  Input command{};
  bool own_only = false;
  int take = 0;            ///< the name that a command holds; 0: none
  Phase phase{};           ///< afterwards
  int outcome = 0;         ///< of a reply
  bool may_end = false;    ///< of kReport: a disk is full, or the process is asked to end
  uint32_t addressed = 0;  ///< nodes, as bits
  friend bool operator==(const ProtocolEvent&, const ProtocolEvent&) = default;
};

/// "node 2 report: recording, run 3".
std::string text_of(const ProtocolEvent& event);

struct ProtocolTrace {
  struct Run {
    Input order{};  ///< what v3dctl was told to do
    int take = 0;
  };
  int nodes = 0;  ///< the first has the trigger
  std::vector<Run> runs;
  std::vector<ProtocolEvent> events;
};

/// Records them. Replies and pulses within a step of a node follow its event. What repeats the
/// event before of its node and run is left out. One thread.
class ProtocolEvents {
 public:
  void add_node(const std::string& node);
  void add_run(const std::string& sender, const CommandMessage& order);

  void on_send(const CommandMessage& command);
  void on_hear(const ReplyMessage& reply);
  void on_command(const std::string& node, const CommandMessage& command, Phase after);
  void on_report(const std::string& node, const CommandMessage& order, Phase after, bool may_end);
  void on_crash(const std::string& node);
  void on_reply(const ReplyMessage& reply);
  void on_pulses_begin(const CommandMessage& order);
  void on_pulses_end();

  const ProtocolTrace& trace() const { return trace_; }

 private:
  bool is_repeated(const ProtocolEvent& event);
  void add_effects();
  ProtocolEvent event_of(ProtocolEvent::Kind kind, const CommandMessage& command);
  ProtocolEvent event_of(ProtocolEvent::Kind kind, const ReplyMessage& reply);
  int take_number(const std::string& name);

  ProtocolTrace trace_;
  std::vector<ProtocolEvent> effects_;  ///< of the step that has not been added yet
  std::map<std::string, int> nodes_, runs_, takes_;
  std::map<std::tuple<ProtocolEvent::Kind, int, int>, ProtocolEvent> last_;  ///< by node and run
};

}  // namespace v3d::simulation
