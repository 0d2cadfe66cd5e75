// How an operator brings all nodes of a studio into one state, over a network that loses, repeats
// and reorders: what is to be sent when, and what the answers mean. Pure: time is an argument.
#pragma once

#include <deque>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "base/time.h"
#include "wire/messages.h"

namespace v3d {

/// What the nodes said to one command.
struct Answer {
  std::map<std::string, ReplyMessage> replies;  ///< the last of each node: final, or still pending
  std::vector<std::string> silent;              ///< nodes that were asked and did not answer

  /// Every node replied "done".
  bool done() const;
};

/// Sender and time of an operator's messages. Nodes take each message of a sender that is not later
/// than the one before for a replay, so time rises whatever the clock does. Pure. One thread.
class CommandStamp {
 public:
  /// `sender`: unique per run of the tool that sends.
  explicit CommandStamp(std::string sender) : sender_(std::move(sender)) {}
  void put_on(CommandMessage& message, RealtimeInstant now);
  const std::string& sender() const { return sender_; }

 private:
  std::string sender_;
  RealtimeInstant last_;
};

/// The nonce that the next command to a node must hold (ReplyMessage::nonce).
struct NodeNonce {
  int64_t value = 0;
  RealtimeInstant command_sent = RealtimeInstant::min();  ///< of the command whose reply held it
};
using NodeNonces = std::map<std::string, NodeNonce>;  ///< by the name of the node

/// The nodes that commands go to.
struct Commanded {
  std::vector<std::string> nodes;
  std::string trigger;  ///< one of them
};

/// One order of an operator, in rounds. Every message is sent again until the nodes of its round
/// have answered. The trigger's node, which alone makes pulses, is the one that decides when two
/// operators want different things: it is the first to be asked to arm, to stop and to abort, and
/// the last to start.
///   arm:         arm at the trigger's node; arm everywhere, until every node is ready; commit
///   background:  the same, then start as below, then the result of every node
///   start:       everywhere but at the trigger's node; there
///   stop, abort: at the trigger's node; everywhere
/// When a node refuses or is silent, what was armed or started for this order is taken back; a
/// start only when the trigger's node has said that no pulses run.
class StudioCoordinator {
 public:
  /// A message is repeated after this.
  static constexpr Duration kRepeatAfter = std::chrono::milliseconds(200);
  /// Stop and abort wait so long for the trigger's node, then turn to all.
  static constexpr Duration kTriggerFirst = std::chrono::seconds(1);
  /// So long it is tried to take back, after the deadline.
  static constexpr Duration kTakeBackWithin = std::chrono::seconds(3);

  /// `order`: verb, take and details; `counter`: that of the operator's last command; `nonces`: as
  /// far as they are known, from the conversation before.
  StudioCoordinator(CommandMessage order, int64_t counter, Commanded studio,
                    MonotonicInstant deadline, NodeNonces nonces = {});

  /// What is to be sent at `now`; empty when nothing is due. Sender and time are the caller's.
  std::optional<CommandMessage> poll(MonotonicInstant now);
  /// When poll() has something to do next.
  MonotonicInstant next_due() const { return next_due_; }
  /// True when the reply says something new. The caller has looked for whom it is.
  bool hear(const ReplyMessage& reply);

  bool over() const { return rounds_.empty(); }
  /// What there is to tell, once it is over.
  const Answer& answer() const { return answer_; }
  /// That of the last command that was sent.
  int64_t counter() const { return counter_; }
  /// As far as they were learnt.
  const NodeNonces& nonces() const { return nonces_; }

 private:
  struct Round {
    CommandVerb verb{};
    std::vector<std::string> nodes;
    bool accepted_is_enough = false;  ///< a pending reply is as good as a final one
    Duration patience{};              ///< then the next round; zero: until the deadline
  };
  void plan();
  void plan_start();
  std::vector<std::string> others() const;
  bool orders() const;
  void learn_nonce(const ReplyMessage& reply);
  int64_t nonce_of(const std::string& node) const;
  bool is_settled(const std::string& node) const;
  bool is_settled() const;
  bool somebody_refused() const;
  void keep_what_was_said();
  void name_the_silent();
  void end_of_round();
  void next_round();
  void begin_round();
  void fail();
  void plan_to_take_back();
  void go_on_taking_back();
  void learn_take();

  CommandMessage order_;
  int64_t counter_;
  const Commanded studio_;
  const MonotonicInstant deadline_;
  std::deque<Round> rounds_;                  ///< the first is on
  std::map<std::string, ReplyMessage> said_;  ///< to the command that is on
  bool taking_back_ = false;
  bool own_only_ = false;
  std::optional<MonotonicInstant> round_began_;  ///< empty until its first message is sent
  MonotonicInstant next_due_;
  NodeNonces nonces_;
  Answer answer_;
};

}  // namespace v3d
