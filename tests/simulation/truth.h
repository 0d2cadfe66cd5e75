// Ground truth of a simulated studio. All answers and ledgers are checked against it.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "daemon/control/control.h"
#include "daemon/control/studio_coordinator.h"
#include "simulation/node_disk.h"
#include "take/ledger/ledger.h"

namespace v3d::simulation {

/// Cause of a change of a node's phase.
enum class Cause : uint8_t {
  kStopOrAbort,   ///< an operator's command
  kTakeBack,      ///< an abort of the sender's own order (CommandMessage::own_only)
  kOtherCommand,  ///< arm, commit, start ...
  kReport,        ///< a report of the node's own work
  kDisk,          ///< such a report, because a disk of this or another node is full
  kRejoined,
  kEnded,  ///< the process crashed or was shut down
};

/// Checks the invariants of docs/protocol.md at every event and keeps the first violation. One
/// thread.
class Truth {
 public:
  struct Studio {
    control::CommandTargets commanded;
    std::map<std::string, std::vector<std::string>> cameras;  ///< by node
  };
  explicit Truth(Studio studio) : studio_(std::move(studio)) {}

  const std::string& violation() const { return violation_; }
  void violate(const std::string& what) {
    if (violation_.empty()) violation_ = what;
  }

  // --- events
  struct Change {
    std::string node;
    control::Phase from{};
    control::Phase to{};
    wire::CommandMessage
        order;  ///< the node's order after the change, or before it if there is none
    Cause cause{};
    wire::CommandMessage command;  ///< the command that is the cause, if any
  };
  void on_change(const Change& change);
  void on_order(const std::string& sender, wire::CommandVerb verb) { verbs_[sender] = verb; }
  /// Called when an order of an operator begins, at any time.
  void on_order_begins(const std::string& sender) { begun_[sender] = ++events_; }
  void on_train(const wire::CommandMessage& order);
  void on_pulse(int64_t pulse, bool sensed);
  void on_trigger_lost() { trains_[running_].trigger_lost = true; }
  void on_frame_written(const std::string& node, const std::string& take, const std::string& id,
                        const std::string& camera, int64_t pulse);
  /// Called when a node removes a take from its disk.
  void on_removed(const std::string& node, const std::string& take, const TakeOnDisk& disk);
  void on_answer(const wire::CommandMessage& order, const std::string& sender, int64_t counter,
                 const control::Answer& answer);
  /// Checks a node's disk at the end: no frame is lost, and the ledgers are right.
  void check_disk(const std::string& node, const NodeDisk& disk);
  /// Checks the joined ledgers of all nodes, by node. "takes collect" joins no parts without that
  /// of a capture node. True when they are joined and reported as complete.
  bool check_joined(const std::string& take, const std::map<std::string, take::Ledger>& parts,
                    bool has_triggers);

  /// Takes for which pulses were made.
  std::vector<std::string> takes() const;
  int64_t pulses_of(const std::string& take) const;

 private:
  struct Train {
    std::string take;
    wire::CommandVerb verb{};
    int64_t pulses = 0;
    int64_t sensed = 0;
    bool trigger_lost = false;  ///< its node ended while the pulses ran
  };
  struct Node {
    control::Phase phase{};
    std::string id;                            ///< of the present order
    std::string started_by;                    ///< sender
    std::set<std::string> committed, started;  ///< all orders so far
    std::map<std::string, Cause> left;         ///< why it left the recording, by order
    std::map<std::string, std::map<std::string, std::set<int64_t>>> written;  ///< take, camera
  };
  void check_take_back(const Change& change, const Node& node);
  void check_recording(const std::string& name, const Node& node, const std::string& id);
  void check_only_winner(const wire::CommandMessage& order, const std::string& sender);
  void check_stop(const control::Answer& answer);
  void check_complete(const take::Ledger& ledger);
  void check_cameras(const std::string& where, const take::Ledger& ledger);
  bool has_pulses(const std::string& take) const;
  bool has_train(const control::Answer& answer) const;
  bool has_frame(const std::string& take, const std::string& camera, int64_t pulse) const;

  const Studio studio_;
  std::string violation_;
  std::map<std::string, wire::CommandVerb> verbs_;  ///< of orders, by sender
  /// An order to arm that was answered "done", and was not ended yet.
  struct Winner {
    std::string sender, take;
    int64_t answered = 0;
  };
  int64_t events_ = 0;                    ///< number of orders that began, and of answers
  std::map<std::string, int64_t> begun_;  ///< when an order began, by sender
  std::map<std::string, int64_t> ended_;  ///< when the trigger's node last left an order, by order
  std::optional<Winner> winner_;
  std::map<std::string, Node> nodes_;
  std::map<std::string, Train> trains_;         ///< by order
  std::map<std::string, std::string> by_take_;  ///< order by take
  std::string running_;
};

}  // namespace v3d::simulation
