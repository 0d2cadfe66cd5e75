#include "daemon/control/studio_coordinator.h"

#include <algorithm>
#include <utility>

namespace v3d::control {
namespace {

using Outcome = wire::ReplyMessage::Outcome;

/// The take name of `v3dctl background`.
constexpr char kBackgroundTake[] = "background";

}  // namespace

bool Answer::done() const {
  return silent.empty() && std::all_of(replies.begin(), replies.end(), [](const auto& entry) {
           return entry.second.outcome == Outcome::kDone;
         });
}

void CommandStamp::apply(wire::CommandMessage& message, RealtimeInstant now) {
  last_ = std::max(now, last_ + std::chrono::microseconds(1));
  message.sender = sender_;
  message.sent = last_;
}

StudioCoordinator::StudioCoordinator(wire::CommandMessage order, int64_t counter,
                                     CommandTargets targets, MonotonicInstant deadline,
                                     NodeNonces nonces)
    : order_(std::move(order)),
      counter_(counter),
      targets_(std::move(targets)),
      deadline_(deadline),
      own_only_(order_.own_only),
      nonces_(std::move(nonces)) {
  if (order_.verb == wire::CommandVerb::kBackground) order_.take = kBackgroundTake;
  plan();
  begin_command();
}

// --- the steps ----------------------------------------------------------------------------------

bool StudioCoordinator::is_arming() const { return is_order(order_.verb); }

std::vector<std::string> StudioCoordinator::others() const {
  std::vector<std::string> others = targets_.nodes;
  std::erase(others, targets_.trigger);
  return others;
}

void StudioCoordinator::plan() {
  const std::vector<std::string> trigger = {targets_.trigger};
  if (order_.verb == wire::CommandVerb::kStart) return plan_start();
  steps_.push_back({.verb = order_.verb,
                    .nodes = trigger,
                    .accepted_is_enough = true,
                    .timeout = is_arming() ? Duration::zero() : kTriggerTimeout});
  steps_.push_back({.verb = order_.verb, .nodes = targets_.nodes});
  if (!is_arming()) return;
  steps_.push_back({.verb = wire::CommandVerb::kCommit, .nodes = targets_.nodes});
  if (order_.verb != wire::CommandVerb::kBackground) return;
  plan_start();
  steps_.push_back({.verb = wire::CommandVerb::kStop, .nodes = targets_.nodes});
}

void StudioCoordinator::plan_start() {
  if (!others().empty()) steps_.push_back({.verb = wire::CommandVerb::kStart, .nodes = others()});
  steps_.push_back({.verb = wire::CommandVerb::kStart, .nodes = {targets_.trigger}});
}

void StudioCoordinator::begin_command() {
  ++counter_;
  replies_.clear();
  step_began_.reset();
  next_due_ = MonotonicInstant();
}

void StudioCoordinator::next_step() {
  const wire::CommandVerb verb = steps_.front().verb;
  steps_.pop_front();
  step_began_.reset();
  next_due_ = MonotonicInstant();
  if (steps_.empty()) return;
  // The same command goes to more nodes, or another one follows.
  if (steps_.front().verb != verb) return begin_command();
  // With one node, the next step has no other nodes to ask.
  if (have_all_replied()) end_of_step();
}

std::optional<wire::CommandMessage> StudioCoordinator::poll(MonotonicInstant now) {
  if (is_finished()) return std::nullopt;
  if (!step_began_) step_began_ = now;
  const MonotonicInstant end = deadline_ + (taking_back_ ? kTakeBackTimeout : Duration::zero());
  const Duration timeout = steps_.front().timeout;
  if (now >= end) {
    fail();
  } else if (timeout > Duration::zero() && now - *step_began_ > timeout) {
    next_step();
  }
  if (is_finished()) return std::nullopt;
  if (now < next_due_) return std::nullopt;
  if (!step_began_) step_began_ = now;
  next_due_ = now + kRepeatAfter;
  wire::CommandMessage message = order_;
  message.verb = steps_.front().verb;
  message.counter = counter_;
  message.own_only = own_only_;
  message.to.clear();
  message.nonces.clear();
  for (const std::string& node : steps_.front().nodes) {
    if (has_replied(node)) continue;
    message.to.push_back(node);
    message.nonces.push_back(nonce_of(node));
  }
  return message;
}

// --- replies ------------------------------------------------------------------------------------

int64_t StudioCoordinator::nonce_of(const std::string& node) const {
  const auto known = nonces_.find(node);
  return known == nonces_.end() ? 0 : known->second.value;
}

/// Uses only the first reply to each message, so that repeated or late replies restore no old
/// nonce. When the node rejected the nonce of a command, the command is due again at once: at most
/// once for each message.
void StudioCoordinator::learn_nonce(const wire::ReplyMessage& reply) {
  const auto& nodes = targets_.nodes;
  if (std::find(nodes.begin(), nodes.end(), reply.node) == nodes.end()) return;
  NodeNonce& known = nonces_[reply.node];
  if (reply.command_sent <= known.command_sent) return;
  if (reply.outcome == Outcome::kNonceMissing && reply.nonce != known.value) {
    next_due_ = MonotonicInstant();
  }
  known = {.value = reply.nonce, .command_sent = reply.command_sent};
}

bool StudioCoordinator::on_reply(const wire::ReplyMessage& reply) {
  learn_nonce(reply);
  if (reply.outcome == Outcome::kNonceMissing) return false;
  if (is_finished() || reply.command_counter != counter_) return false;
  const auto& nodes = steps_.front().nodes;
  if (std::find(nodes.begin(), nodes.end(), reply.node) == nodes.end()) return false;
  const auto known = replies_.find(reply.node);
  if (known != replies_.end()) {
    const wire::ReplyMessage& last = known->second;
    const bool same = last.outcome == reply.outcome && last.text == reply.text;
    if (last.outcome != Outcome::kPending || same) return false;
  }
  bind_take(reply);
  wire::ReplyMessage& stored = replies_[reply.node] = reply;
  if (starts_another_take(reply)) {
    stored.outcome = Outcome::kRefused;
    stored.text = "the take here is " + reply.take + ", not " + order_.take;
  }
  if (have_all_replied()) end_of_step();
  return true;
}

/// Restricts a start or stop without a take name to the take that the first node starts or stops.
/// A final reply to a stop may name an earlier take, whose result the node still has.
void StudioCoordinator::bind_take(const wire::ReplyMessage& reply) {
  if (taking_back_ || !order_.take.empty()) return;
  const bool starts = order_.verb == wire::CommandVerb::kStart && reply.outcome == Outcome::kDone;
  const bool stops = order_.verb == wire::CommandVerb::kStop && reply.outcome == Outcome::kPending;
  if (starts || stops) order_.take = reply.take;
}

/// A command without a take name may reach a node late, when it is armed for the next take.
bool StudioCoordinator::starts_another_take(const wire::ReplyMessage& reply) const {
  return steps_.front().verb == wire::CommandVerb::kStart && reply.outcome == Outcome::kDone &&
         reply.take != order_.take;
}

bool StudioCoordinator::has_replied(const std::string& node) const {
  const auto found = replies_.find(node);
  if (found == replies_.end()) return false;
  return found->second.outcome != Outcome::kPending || steps_.front().accepted_is_enough;
}

bool StudioCoordinator::have_all_replied() const {
  const auto& nodes = steps_.front().nodes;
  return std::all_of(nodes.begin(), nodes.end(),
                     [&](const std::string& node) { return has_replied(node); });
}

bool StudioCoordinator::any_refused() const {
  return std::any_of(replies_.begin(), replies_.end(),
                     [](const auto& entry) { return entry.second.outcome == Outcome::kRefused; });
}

/// Adds the replies of this step to the answer. A "done" of a later step, such as commit, does not
/// replace the reply to the order itself.
void StudioCoordinator::store_replies() {
  const bool is_later = is_arming() && steps_.front().verb != order_.verb;
  const bool result = is_later && steps_.front().verb == wire::CommandVerb::kStop;
  for (const auto& [node, reply] : replies_) {
    if (is_later && !result && reply.outcome == Outcome::kDone) continue;
    answer_.replies[node] = reply;
  }
}

void StudioCoordinator::record_silent_nodes() {
  for (const std::string& node : steps_.front().nodes) {
    if (replies_.contains(node)) continue;
    answer_.silent.push_back(node);
    answer_.replies.erase(node);
  }
}

void StudioCoordinator::end_of_step() {
  if (taking_back_) return continue_take_back();
  const bool ends =
      order_.verb == wire::CommandVerb::kStop || order_.verb == wire::CommandVerb::kAbort;
  // A node that refuses a stop or abort does not prevent those of the other nodes.
  if (any_refused() && !ends) return fail();
  store_replies();
  adopt_take();
  next_step();
}

/// Restricts an order without a take name to the take that the nodes reply. An abort applies to
/// any.
void StudioCoordinator::adopt_take() {
  if (!order_.take.empty() || order_.verb == wire::CommandVerb::kAbort) return;
  for (const auto& [node, reply] : replies_) {
    if (reply.outcome != Outcome::kRefused && !reply.take.empty()) order_.take = reply.take;
  }
}

// --- taking back --------------------------------------------------------------------------------

/// A take that cannot be armed or started on all nodes is aborted on all. Exceptions: takes of
/// other operators (own_only), and a take that runs or may run, as the trigger's node replies.
/// Nodes that record without pulses end by themselves when the trigger's node reports another
/// state.
void StudioCoordinator::plan_take_back() {
  const auto step = [](std::vector<std::string> nodes) {
    return Step{
        .verb = wire::CommandVerb::kAbort, .nodes = std::move(nodes), .accepted_is_enough = true};
  };
  const bool first = steps_.front().verb == order_.verb && steps_.front().accepted_is_enough;
  const std::vector<std::string> asked = steps_.front().nodes;
  steps_.clear();
  if (order_.verb == wire::CommandVerb::kStart) {
    // The others are aborted only if the trigger's node replies: otherwise pulses may run.
    steps_.push_back(step({targets_.trigger}));
    steps_.push_back(step(targets_.nodes));
  } else if (is_arming() && !first) {
    steps_.push_back(step(targets_.nodes));
  } else if (is_arming() && !any_refused()) {
    steps_.push_back(step(asked));
  }
}

void StudioCoordinator::fail() {
  if (taking_back_) return steps_.clear();
  store_replies();
  record_silent_nodes();
  adopt_take();
  plan_take_back();
  if (is_finished()) return;
  taking_back_ = true;
  own_only_ = true;
  begin_command();
}

/// After the first step of taking back a start, the trigger's node has replied whether the take
/// runs. If it does not run there, no operator can start it any more, so it must end on all nodes.
void StudioCoordinator::continue_take_back() {
  if (steps_.size() == 1 || any_refused() || order_.take.empty()) return steps_.clear();
  own_only_ = false;
  next_step();
}

}  // namespace v3d::control
