#include "daemon/command_gate.h"

#include <algorithm>
#include <cstdio>
#include <utility>

namespace v3d {
namespace {

/// So long a refusal is worth a line in health.
constexpr Duration kTold = std::chrono::seconds(10);

std::string seconds_text(Duration d) {
  char text[32];
  std::snprintf(text, sizeof text, "%.1f s", to_seconds(d));
  return text;
}

}  // namespace

CommandGate::CommandGate(std::string node, RealtimeInstant began)
    : node_(std::move(node)), floor_(began + kAhead) {}

void CommandGate::set_key(const StudioKey& key) {
  const std::lock_guard lock(mutex_);
  key_ = key;
}

bool CommandGate::has_key() const {
  const std::lock_guard lock(mutex_);
  return key_.has_value();
}

CommandCounts CommandGate::counts() const {
  const std::lock_guard lock(mutex_);
  return counts_;
}

std::string CommandGate::trouble(RealtimeInstant now) const {
  const std::lock_guard lock(mutex_);
  return now - troubled_ < kTold ? trouble_ : "";
}

std::optional<CommandMessage> CommandGate::admit(std::span<const uint8_t> bytes,
                                                 RealtimeInstant now) {
  const std::lock_guard lock(mutex_);
  auto command = judge(bytes, now);
  if (!command) return std::nullopt;
  ++counts_.believed;
  const bool meant = std::find(command->to.begin(), command->to.end(), node_) != command->to.end();
  if (!meant) return std::nullopt;
  return command;
}

std::optional<CommandMessage> CommandGate::judge(std::span<const uint8_t> bytes,
                                                 RealtimeInstant now) {
  if (!key_) {
    ++counts_.unkeyed;
    return std::nullopt;
  }
  if (!key_->has_sealed(bytes)) {
    ++counts_.forged;
    note("forged commands are refused: a stranger, or another studio key than here", now);
    return std::nullopt;
  }
  auto command = decode<CommandMessage>(bytes);
  if (!command) {
    ++counts_.malformed;
    note("sealed commands are refused that make no sense here: another version of V3D?", now);
    return std::nullopt;
  }
  if (!is_fresh(*command, now) || !is_new(*command)) return std::nullopt;
  remember(*command);
  return command;
}

bool CommandGate::is_fresh(const CommandMessage& command, RealtimeInstant now) {
  const Duration age = now - command.sent;
  if (age <= kOldest && -age <= kAhead) return true;
  ++counts_.stale;
  note("commands of " + command.sender + " are refused: sent " +
           seconds_text(age > Duration::zero() ? age : -age) +
           (age > Duration::zero() ? " ago" : " in the future") +
           "; do the clocks agree? Try: chronyc tracking, here and there",
       now);
  return false;
}

bool CommandGate::is_new(const CommandMessage& command) {
  const auto known = senders_.find(command.sender);
  if (known == senders_.end()) {
    if (command.sent > floor_) return true;
    ++counts_.early;
    return false;
  }
  const Heard& last = known->second;
  if (command.sent > last.sent && command.counter >= last.counter) return true;
  ++counts_.replayed;
  return false;
}

void CommandGate::remember(const CommandMessage& command) {
  if (senders_.size() == kMaxSenders && !senders_.contains(command.sender)) {
    const auto oldest = std::min_element(
        senders_.begin(), senders_.end(),
        [](const auto& a, const auto& b) { return a.second.sent < b.second.sent; });
    floor_ = std::max(floor_, oldest->second.sent);
    senders_.erase(oldest);
  }
  senders_[command.sender] = {.counter = command.counter, .sent = command.sent};
}

void CommandGate::note(const std::string& trouble, RealtimeInstant now) {
  trouble_ = trouble;
  troubled_ = now;
}

}  // namespace v3d
