#include "simulation/protocol_events.h"

#include <utility>

#include "daemon/control/control.h"

namespace v3d::simulation {
namespace {

using Kind = ProtocolEvent::Kind;

std::string name_of(Kind kind) {
  constexpr const char* kNames[] = {"command",      "report",     "reply", "crash",
                                    "pulses begin", "pulses end", "send",  "receive"};
  return kNames[static_cast<size_t>(kind)];
}

}  // namespace

std::string text_of(const ProtocolEvent& event) {
  const bool is_command = event.kind == Kind::kCommand || event.kind == Kind::kSend;
  return "node " + std::to_string(event.node) + " " + name_of(event.kind) + ": " +
         (is_command ? std::string(name(event.command)) + (event.own_only ? " own" : "") + ", "
                     : "") +
         std::string(name(event.phase)) + ", run " + std::to_string(event.run) + ", counter " +
         std::to_string(event.counter) + ", take " + std::to_string(event.take) + ", outcome " +
         std::to_string(event.outcome) + ", to " + std::to_string(event.addressed);
}

void ProtocolEvents::add_node(const std::string& node) { nodes_.emplace(node, trace_.nodes++); }

int ProtocolEvents::take_number(const std::string& name) {
  if (name.empty()) return 0;
  return takes_.emplace(name, static_cast<int>(takes_.size()) + 1).first->second;
}

void ProtocolEvents::add_run(const std::string& sender, const wire::CommandMessage& order) {
  runs_.emplace(sender, static_cast<int>(trace_.runs.size()));
  trace_.runs.push_back({.order = control::input_of(order.verb), .take = take_number(order.take)});
}

ProtocolEvent ProtocolEvents::event_of(Kind kind, const wire::CommandMessage& command) {
  ProtocolEvent event{.kind = kind};
  event.run = runs_.at(command.sender);
  event.counter = command.counter;
  event.command = control::input_of(command.verb);
  event.own_only = command.own_only;
  event.take = take_number(command.take);
  for (const std::string& node : command.to) event.addressed |= 1U << nodes_.at(node);
  return event;
}

ProtocolEvent ProtocolEvents::event_of(Kind kind, const wire::ReplyMessage& reply) {
  ProtocolEvent event{.kind = kind};
  event.node = nodes_.at(reply.node);
  event.run = runs_.at(reply.command_sender);
  event.counter = reply.command_counter;
  event.outcome = static_cast<int>(reply.outcome);
  return event;
}

/// `background` gets its take name from StudioCoordinator (daemon/control/studio_coordinator.cc).
void ProtocolEvents::on_send(const wire::CommandMessage& command) {
  const ProtocolEvent event = event_of(Kind::kSend, command);
  if (event.command == control::Input::kBackground) trace_.runs[event.run].take = event.take;
  if (is_repeated(event)) return;
  trace_.events.push_back(event);
}

void ProtocolEvents::on_receive(const wire::ReplyMessage& reply) {
  if (reply.outcome == wire::ReplyMessage::Outcome::kNonceMissing) return;
  const ProtocolEvent event = event_of(Kind::kReceive, reply);
  if (!is_repeated(event)) trace_.events.push_back(event);
}

void ProtocolEvents::on_command(const std::string& node, const wire::CommandMessage& command,
                                control::Phase after) {
  ProtocolEvent event = event_of(Kind::kCommand, command);
  event.node = nodes_.at(node);
  event.phase = after;
  event.addressed = 0;
  if (!is_repeated(event)) trace_.events.push_back(event);
  add_effects();
}

void ProtocolEvents::on_report(const std::string& node, const wire::CommandMessage& order,
                               control::Phase after, bool may_end) {
  ProtocolEvent event{.kind = Kind::kReport};
  event.node = nodes_.at(node);
  event.run = runs_.at(order.sender);
  event.phase = after;
  event.may_end = may_end;
  trace_.events.push_back(event);
  add_effects();
}

void ProtocolEvents::on_crash(const std::string& node) {
  ProtocolEvent event{.kind = Kind::kCrash};
  event.node = nodes_.at(node);
  trace_.events.push_back(event);
  add_effects();
  std::erase_if(last_, [&](const auto& entry) {
    return std::get<0>(entry.first) == Kind::kCommand && std::get<1>(entry.first) == event.node;
  });
}

void ProtocolEvents::on_reply(const wire::ReplyMessage& reply) {
  if (reply.outcome == wire::ReplyMessage::Outcome::kNonceMissing) return;
  const ProtocolEvent event = event_of(Kind::kReply, reply);
  if (!is_repeated(event)) effects_.push_back(event);
}

void ProtocolEvents::on_pulses_begin(const wire::CommandMessage& order) {
  ProtocolEvent event{.kind = Kind::kPulsesBegin};
  event.run = runs_.at(order.sender);
  effects_.push_back(event);
}

void ProtocolEvents::on_pulses_end() { effects_.push_back({.kind = Kind::kPulsesEnd}); }

bool ProtocolEvents::is_repeated(const ProtocolEvent& event) {
  ProtocolEvent& last = last_[{event.kind, event.node, event.run}];
  return std::exchange(last, event) == event;
}

void ProtocolEvents::add_effects() {
  trace_.events.insert(trace_.events.end(), effects_.begin(), effects_.end());
  effects_.clear();
}

}  // namespace v3d::simulation
