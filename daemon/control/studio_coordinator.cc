#include "daemon/control/studio_coordinator.h"

#include <algorithm>
#include <utility>

namespace v3d {
namespace {

using Outcome = ReplyMessage::Outcome;

/// What `v3dctl background` arms.
constexpr char kBackgroundTake[] = "background";

}  // namespace

bool Answer::done() const {
  return silent.empty() && std::all_of(replies.begin(), replies.end(), [](const auto& entry) {
           return entry.second.outcome == Outcome::kDone;
         });
}

void CommandStamp::put_on(CommandMessage& message, RealtimeInstant now) {
  last_ = std::max(now, last_ + std::chrono::microseconds(1));
  message.sender = sender_;
  message.sent = last_;
}

StudioCoordinator::StudioCoordinator(CommandMessage order, int64_t counter, Commanded studio,
                                     MonotonicInstant deadline, NodeNonces nonces)
    : order_(std::move(order)),
      counter_(counter),
      studio_(std::move(studio)),
      deadline_(deadline),
      nonces_(std::move(nonces)) {
  if (order_.verb == CommandVerb::kBackground) order_.take = kBackgroundTake;
  plan();
  begin_round();
}

// --- the rounds ---------------------------------------------------------------------------------

bool StudioCoordinator::orders() const { return is_order(order_.verb); }

std::vector<std::string> StudioCoordinator::others() const {
  std::vector<std::string> others = studio_.nodes;
  std::erase(others, studio_.trigger);
  return others;
}

void StudioCoordinator::plan() {
  const std::vector<std::string> trigger = {studio_.trigger};
  if (order_.verb == CommandVerb::kStart) return plan_start();
  rounds_.push_back({.verb = order_.verb,
                     .nodes = trigger,
                     .accepted_is_enough = true,
                     .patience = orders() ? Duration::zero() : kTriggerFirst});
  rounds_.push_back({.verb = order_.verb, .nodes = studio_.nodes});
  if (!orders()) return;
  rounds_.push_back({.verb = CommandVerb::kCommit, .nodes = studio_.nodes});
  if (order_.verb != CommandVerb::kBackground) return;
  plan_start();
  rounds_.push_back({.verb = CommandVerb::kStop, .nodes = studio_.nodes});
}

void StudioCoordinator::plan_start() {
  if (!others().empty()) rounds_.push_back({.verb = CommandVerb::kStart, .nodes = others()});
  rounds_.push_back({.verb = CommandVerb::kStart, .nodes = {studio_.trigger}});
}

void StudioCoordinator::begin_round() {
  ++counter_;
  said_.clear();
  round_began_.reset();
  next_due_ = MonotonicInstant();
}

void StudioCoordinator::next_round() {
  const CommandVerb verb = rounds_.front().verb;
  rounds_.pop_front();
  round_began_.reset();
  next_due_ = MonotonicInstant();
  if (rounds_.empty()) return;
  // The same command goes to more nodes, or another one follows.
  if (rounds_.front().verb != verb) return begin_round();
  // There are no more where the studio has one node.
  if (is_settled()) end_of_round();
}

std::optional<CommandMessage> StudioCoordinator::poll(MonotonicInstant now) {
  if (over()) return std::nullopt;
  if (!round_began_) round_began_ = now;
  const MonotonicInstant end = deadline_ + (taking_back_ ? kTakeBackWithin : Duration::zero());
  const Duration patience = rounds_.front().patience;
  if (now >= end) {
    fail();
  } else if (patience > Duration::zero() && now - *round_began_ > patience) {
    next_round();
  }
  if (over()) return std::nullopt;
  if (now < next_due_) return std::nullopt;
  if (!round_began_) round_began_ = now;
  next_due_ = now + kRepeatAfter;
  CommandMessage message = order_;
  message.verb = rounds_.front().verb;
  message.counter = counter_;
  message.own_only = own_only_;
  message.to.clear();
  message.nonces.clear();
  for (const std::string& node : rounds_.front().nodes) {
    if (is_settled(node)) continue;
    message.to.push_back(node);
    message.nonces.push_back(nonce_of(node));
  }
  return message;
}

// --- what the nodes say -------------------------------------------------------------------------

int64_t StudioCoordinator::nonce_of(const std::string& node) const {
  const auto known = nonces_.find(node);
  return known == nonces_.end() ? 0 : known->second.value;
}

/// Learns from the first reply to each message, so replies that are repeated or late bring no old
/// nonce back. Sends a command again at once when the node rejected the nonce that it held: at most
/// once for each message.
void StudioCoordinator::learn_nonce(const ReplyMessage& reply) {
  const auto& nodes = studio_.nodes;
  if (std::find(nodes.begin(), nodes.end(), reply.node) == nodes.end()) return;
  NodeNonce& known = nonces_[reply.node];
  if (reply.command_sent <= known.command_sent) return;
  if (reply.outcome == Outcome::kNonceMissing && reply.nonce != known.value) {
    next_due_ = MonotonicInstant();
  }
  known = {.value = reply.nonce, .command_sent = reply.command_sent};
}

bool StudioCoordinator::hear(const ReplyMessage& reply) {
  learn_nonce(reply);
  if (reply.outcome == Outcome::kNonceMissing) return false;
  if (over() || reply.command_counter != counter_) return false;
  const auto& nodes = rounds_.front().nodes;
  if (std::find(nodes.begin(), nodes.end(), reply.node) == nodes.end()) return false;
  const auto known = said_.find(reply.node);
  if (known != said_.end()) {
    const ReplyMessage& last = known->second;
    const bool same = last.outcome == reply.outcome && last.text == reply.text;
    if (last.outcome != Outcome::kPending || same) return false;
  }
  said_[reply.node] = reply;
  if (is_settled()) end_of_round();
  return true;
}

bool StudioCoordinator::is_settled(const std::string& node) const {
  const auto found = said_.find(node);
  if (found == said_.end()) return false;
  return found->second.outcome != Outcome::kPending || rounds_.front().accepted_is_enough;
}

bool StudioCoordinator::is_settled() const {
  const auto& nodes = rounds_.front().nodes;
  return std::all_of(nodes.begin(), nodes.end(),
                     [&](const std::string& node) { return is_settled(node); });
}

bool StudioCoordinator::somebody_refused() const {
  return std::any_of(said_.begin(), said_.end(),
                     [](const auto& entry) { return entry.second.outcome == Outcome::kRefused; });
}

/// That a node agrees to the next step is no news: what it said to the order itself stays.
void StudioCoordinator::keep_what_was_said() {
  const bool step = orders() && rounds_.front().verb != order_.verb;
  const bool result = step && rounds_.front().verb == CommandVerb::kStop;
  for (const auto& [node, reply] : said_) {
    if (step && !result && reply.outcome == Outcome::kDone) continue;
    answer_.replies[node] = reply;
  }
}

void StudioCoordinator::name_the_silent() {
  for (const std::string& node : rounds_.front().nodes) {
    if (said_.contains(node)) continue;
    answer_.silent.push_back(node);
    answer_.replies.erase(node);
  }
}

void StudioCoordinator::end_of_round() {
  if (taking_back_) return go_on_taking_back();
  const bool ends = order_.verb == CommandVerb::kStop || order_.verb == CommandVerb::kAbort;
  // A node that has nothing to stop is no reason not to stop the others.
  if (somebody_refused() && !ends) return fail();
  keep_what_was_said();
  learn_take();
  next_round();
}

/// From now on the order is about the take that the nodes are at. An abort is about any.
void StudioCoordinator::learn_take() {
  if (!order_.take.empty() || order_.verb == CommandVerb::kAbort) return;
  for (const auto& [node, reply] : said_) {
    if (reply.outcome != Outcome::kRefused && !reply.take.empty()) order_.take = reply.take;
  }
}

// --- when it goes wrong -------------------------------------------------------------------------

/// What cannot be armed or started everywhere is armed nowhere. What another operator has begun
/// meanwhile stays (own_only), and so does a take that runs, or may run: its trigger's node says
/// so. Nodes that record without pulses end by themselves when they hear that node at something
/// else.
void StudioCoordinator::plan_to_take_back() {
  const auto round = [](std::vector<std::string> nodes) {
    return Round{
        .verb = CommandVerb::kAbort, .nodes = std::move(nodes), .accepted_is_enough = true};
  };
  const bool first = rounds_.front().verb == order_.verb && rounds_.front().accepted_is_enough;
  const std::vector<std::string> asked = rounds_.front().nodes;
  rounds_.clear();
  if (order_.verb == CommandVerb::kStart) {
    // Only its word ends the others: as long as it is silent, pulses may run.
    rounds_.push_back(round({studio_.trigger}));
    rounds_.push_back(round(studio_.nodes));
  } else if (orders() && !first) {
    rounds_.push_back(round(studio_.nodes));
  } else if (orders() && !somebody_refused()) {
    rounds_.push_back(round(asked));
  }
}

void StudioCoordinator::fail() {
  if (taking_back_) return rounds_.clear();
  keep_what_was_said();
  name_the_silent();
  learn_take();
  plan_to_take_back();
  if (over()) return;
  taking_back_ = true;
  own_only_ = true;
  begin_round();
}

/// A start that is taken back: the trigger's node has said whether the take runs all the same. When
/// it is off there, nobody can start it any more, and it must end everywhere.
void StudioCoordinator::go_on_taking_back() {
  if (rounds_.size() == 1 || somebody_refused() || order_.take.empty()) return rounds_.clear();
  own_only_ = false;
  next_round();
}

}  // namespace v3d
