#include "daemon/control/command_replay_filter.h"

#include <algorithm>
#include <array>
#include <utility>

namespace v3d::control {
namespace {

/// How long health mentions a rejected command.
constexpr Duration kReportedFor = std::chrono::seconds(10);

}  // namespace

CommandReplayFilter::CommandReplayFilter(std::string node, std::function<int64_t()> draw)
    : node_(std::move(node)), draw_(std::move(draw)) {
  constexpr size_t kLongestProblem = 256;
  problem_.reserve(kLongestProblem);
}

CommandCounts CommandReplayFilter::counts() const {
  const std::lock_guard lock(mutex_);
  return counts_;
}

std::string CommandReplayFilter::problem(MonotonicInstant now) const {
  const std::lock_guard lock(mutex_);
  return problem_time_ && now - *problem_time_ < kReportedFor ? problem_ : "";
}

int64_t CommandReplayFilter::nonce(MonotonicInstant now) {
  const std::lock_guard lock(mutex_);
  renew_nonces(now);
  return nonce_.value;
}

wire::ReplyMessage CommandReplayFilter::nonce_reply(const wire::CommandMessage& command,
                                                    MonotonicInstant now) {
  wire::ReplyMessage reply;
  reply.node = node_;
  reply.command_sender = command.sender;
  reply.command_counter = command.counter;
  reply.command_sent = command.sent;
  reply.nonce = nonce(now);
  reply.outcome = wire::ReplyMessage::Outcome::kNonceMissing;
  return reply;
}

std::optional<CommandReplayFilter::Admitted> CommandReplayFilter::admit(
    std::span<const uint8_t> bytes, MonotonicInstant now) {
  const std::lock_guard lock(mutex_);
  auto command = read(bytes, now);
  if (!command) return std::nullopt;
  if (std::ranges::find(command->to, node_) == command->to.end()) return std::nullopt;
  renew_nonces(now);
  if (!has_current_nonce(*command, now)) {
    ++counts_.without_nonce;
    if (!may_reply_nonce(command->sender, now)) return std::nullopt;
    return Admitted{.command = std::move(*command), .is_current = false};
  }
  if (!is_new(*command)) {
    ++counts_.replayed;
    return std::nullopt;
  }
  record(*command, now);
  ++counts_.admitted;
  return Admitted{.command = std::move(*command), .is_current = true};
}

std::optional<wire::CommandMessage> CommandReplayFilter::read(std::span<const uint8_t> bytes,
                                                              MonotonicInstant now) {
  if (!credentials_.is_complete()) {
    ++counts_.unkeyed;
    return std::nullopt;
  }
  const bus::OpenedCommand opened = credentials_.open_command(bytes, now);
  if (opened.result != bus::OpenedCommand::Result::kAccepted) {
    count_rejected(opened, now);
    return std::nullopt;
  }
  auto command = wire::decode<wire::CommandMessage>(opened.message);
  if (!command) {
    ++counts_.malformed;
    set_problem(
        "authentic commands are rejected because they cannot be decoded: another version of V3D?",
        now);
  }
  return command;
}

void CommandReplayFilter::count_rejected(const bus::OpenedCommand& opened, MonotonicInstant now) {
  if (opened.result == bus::OpenedCommand::Result::kUnauthorized) {
    ++counts_.unauthorized;
    return set_problem(
        "commands of " + opened.signer + " are rejected: this member is not an operator", now);
  }
  ++counts_.forged;
  set_problem(
      "forged commands are rejected: an attacker, or another studio key or member list than here",
      now);
}

// --- nonces -------------------------------------------------------------------------------------

bool CommandReplayFilter::has_current_nonce(const wire::CommandMessage& command,
                                            MonotonicInstant now) const {
  const auto index = std::ranges::find(command.to, node_) - command.to.begin();
  if (index >= std::ssize(command.nonces)) return false;
  const int64_t held = command.nonces[static_cast<size_t>(index)];
  return std::ranges::any_of(std::array{nonce_, nonce_before_}, [&](const Nonce& nonce) {
    return nonce.value == held && nonce.is_current(now);
  });
}

bool CommandReplayFilter::may_reply_nonce(const std::string& sender, MonotonicInstant now) {
  if (now - replies_since_ >= std::chrono::seconds(1)) {
    replies_since_ = now;
    nonce_replies_ = 0;
    nonce_replies_to_.clear();
  }
  if (nonce_replies_ == kMaxNonceReplies) return false;
  int& to_sender = nonce_replies_to_[std::hash<std::string>()(sender)];
  if (to_sender == kMaxNonceRepliesToSender) return false;
  ++to_sender;
  ++nonce_replies_;
  return true;
}

void CommandReplayFilter::renew_nonces(MonotonicInstant now) {
  if (!nonce_.is_current(now)) return draw_nonces(now);
  if (now - nonce_.drawn < kNonceLife) return;
  nonce_before_ = std::exchange(nonce_, {.value = draw_(), .drawn = now});
  senders_before_ = std::exchange(senders_, {});
}

void CommandReplayFilter::draw_nonces(MonotonicInstant now) {
  nonce_ = {.value = draw_(), .drawn = now};
  nonce_before_ = {};
  senders_.clear();
  senders_before_.clear();
}

// --- replays ------------------------------------------------------------------------------------

bool CommandReplayFilter::is_new(const wire::CommandMessage& command) {
  return std::ranges::all_of(std::array{&senders_, &senders_before_}, [&](const auto* senders) {
    const auto known = senders->find(command.sender);
    if (known == senders->end()) return true;
    const Received& last = known->second;
    return command.sent > last.sent && command.counter >= last.counter;
  });
}

void CommandReplayFilter::record(const wire::CommandMessage& command, MonotonicInstant now) {
  if (senders_.size() == kMaxSenders && !senders_.contains(command.sender)) draw_nonces(now);
  senders_[command.sender] = {.counter = command.counter, .sent = command.sent};
}

void CommandReplayFilter::set_problem(std::string_view problem, MonotonicInstant now) {
  problem_ = problem;
  problem_time_ = now;
}

}  // namespace v3d::control
