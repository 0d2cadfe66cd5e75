#include "daemon/node/node_loop.h"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <cmath>

#include "base/error.h"
#include "daemon/node/service.h"
#include "wire/channels.h"

namespace v3d {
namespace {

constexpr size_t kCommandQueue = 64;

}  // namespace

NodeLoop::NodeLoop(NodeIdentity identity, Bus& bus, NodeDelegate& work)
    : me_(std::move(identity)),
      bus_(bus),
      work_(work),
      protocol_(
          me_.node, work, [this](ReplyMessage reply) { publish(std::move(reply)); },
          Monotonic::now()),
      gate_(me_.node),
      files_(me_.credentials, gate_.credentials(), bus.seal()),
      commands_(
          bus, kCommandChannel, kCommandQueue,
          [this](const ReceivedMessage& in) { return gate_.admit(in.bytes, Monotonic::now()); }),
      name_monitor_(bus, me_.node),
      metrics_(serve_metrics(me_.metrics)),
      watchdog_(service::watchdog_period()),
      last_fed_(Monotonic::now()) {
  read_credentials();
}

void NodeLoop::read_credentials() {
  const std::string news = files_.poll(Monotonic::now());
  if (news.empty()) return;
  const std::string problem = credential_problem();
  if (problem.empty()) return spdlog::info("{}", news);
  spdlog::error("{}", problem);
}

std::string NodeLoop::credential_problem() const {
  return files_.is_ready() ? files_.problem() : "every command is refused: " + files_.problem();
}

void NodeLoop::run() {
  service::ready();
  spdlog::info("{} ready", me_.node);
  while (!stop_requested()) turn();
  service::stopping();
  shut_down();
}

void NodeLoop::turn() {
  if (const auto admitted = commands_.wait(next_turn())) on_command(*admitted);
  // Without a key nobody may command this node, and nothing that it hears is believed either.
  protocol_.poll(Monotonic::now(), files_.is_ready());
  if (protocol_.is_health_due(Monotonic::now())) publish_health();
  feed_watchdog();
}

void NodeLoop::on_command(const CommandGate::Admitted& admitted) {
  const CommandMessage& command = admitted.command;
  spdlog::debug("{} {} from {} #{}", name(command.verb), command.take, command.sender,
                command.counter);
  if (!admitted.is_current) return publish(gate_.nonce_reply(command, Monotonic::now()));
  if (!is_refused_for_name(command)) protocol_.on_command(command);
}

/// Both processes refuse to begin anything. A take that runs goes on, and can be stopped.
bool NodeLoop::is_refused_for_name(const CommandMessage& command) {
  if (name_alarm_.empty() || !is_order(command.verb)) return false;
  ReplyMessage reply = gate_.nonce_reply(command, Monotonic::now());
  reply.outcome = ReplyMessage::Outcome::kRefused;
  reply.text = name_alarm_;
  publish(std::move(reply));
  return true;
}

MonotonicInstant NodeLoop::next_turn() const {
  const MonotonicInstant now = Monotonic::now();
  const MonotonicInstant next = protocol_.next_poll(now);
  return watchdog_ ? std::min(next, now + *watchdog_ / 4) : next;
}

void NodeLoop::publish(ReplyMessage reply) {
  // Who has no key has believed no command.
  if (!files_.is_ready()) return;
  const MonotonicInstant now = Monotonic::now();
  reply.nonce = gate_.nonce(now);
  reply.sent = Realtime::now();
  bus_.publish_reply(gate_.credentials().seal(encode(reply), now));
}

void NodeLoop::publish_health() {
  read_credentials();
  HealthMessage health = protocol_.health(Monotonic::now());
  follow_clock(health);
  health.sent = Realtime::now();
  health.program = me_.program;
  health.version = V3D_VERSION;
  machine_.report(health.values);
  clock_.report(health.values);
  ptp_.report(health.values);
  report_commands(health);
  watch_name(health);
  bus_.publish_sealed(health_channel(me_.node), encode(health));
  if (metrics_) metrics_->update(health);
  service::status(std::string(name(health.state)) + (health.take.empty() ? "" : " ") + health.take +
                  (health.text.empty() ? "" : ": ") + health.text);
}

void NodeLoop::watch_name(HealthMessage& health) {
  name_monitor_.mark(health);
  const std::string alarm = name_monitor_.alarm(Monotonic::now());
  if (!alarm.empty() && name_alarm_.empty()) spdlog::error("{}", alarm);
  name_alarm_ = alarm;
  if (!alarm.empty() && health.state != NodeState::kFault) health.text = alarm;
}

/// A take keeps the time that it began with.
void NodeLoop::follow_clock(HealthMessage& health) {
  const Duration step = Realtime::step();
  health.values["clock_step_s"] = to_seconds(step);
  const bool is_new = std::chrono::abs(step - told_step_) > RealtimeFollower::kSlew;
  told_step_ = step;
  if (is_new && step != Duration::zero()) {
    ++clock_steps_;
    const bool is_back = step < Duration::zero();
    spdlog::warn("the clock was set {} by {:.1f} s; v3dctl doctor tells whether it is synchronised",
                 is_back ? "back" : "ahead", std::abs(to_seconds(step)));
  }
  health.values["clock_steps"] = static_cast<double>(clock_steps_);
  if (step == Duration::zero()) return;
  if (health.state == NodeState::kIdle) {
    told_step_ = {};
    return Realtime::adopt_step();
  }
  if (!health.text.empty()) return;
  health.text = fmt::format("the clock was set by {:+.1f} s; this take keeps the time of before",
                            to_seconds(step));
}

void NodeLoop::report_commands(HealthMessage& health) const {
  const CommandCounts counts = gate_.counts();
  const auto value = [&](const char* name, int64_t n) {
    health.values[name] = static_cast<double>(n);
  };
  value("commands_received", counts.admitted);
  value("commands_dropped", commands_.counts().dropped);
  value("commands_forged", counts.forged);
  value("commands_unauthorized", counts.unauthorized);
  value("commands_malformed", counts.malformed);
  value("commands_without_nonce", counts.without_nonce);
  value("commands_replayed", counts.replayed);
  value("commands_unkeyed", counts.unkeyed);
  const SealCounts messages = bus_.seal().counts();
  value("messages_forged", messages.forged);
  value("messages_unkeyed", messages.unkeyed);
  value("messages_stale", messages.stale);
  value("messages_replayed", messages.replayed);
  const ReceptionCounts reception = bus_.reception();
  value("messages_incomplete", reception.datagrams.incomplete);
  value("datagrams_malformed", reception.datagrams.malformed);
  value("datagrams_foreign", reception.datagrams.foreign);
  value("datagrams_oversized", reception.datagrams.oversized);
  value("datagrams_dropped_by_kernel", reception.dropped_by_kernel);
  std::string trouble = credential_problem();
  if (trouble.empty()) trouble = gate_.problem(Monotonic::now());
  if (trouble.empty()) trouble = bus_.seal().trouble(Realtime::now());
  const bool is_free =
      health.state != NodeState::kFault && (health.text.empty() || !files_.is_ready());
  if (is_free) health.text = trouble;
}

void NodeLoop::feed_watchdog() {
  if (!watchdog_ || Monotonic::now() - last_fed_ < *watchdog_ / 4) return;
  // A pipeline that stands still is not fed, and systemd starts the daemon again.
  if (!work_.progressed_since(Monotonic::now() - *watchdog_ / 2)) return;
  service::feed_watchdog();
  last_fed_ = Monotonic::now();
}

void NodeLoop::shut_down() {
  spdlog::info("{} stopping", me_.node);
  protocol_.begin_shutdown(Monotonic::now());
  while (!protocol_.may_shut_down(Monotonic::now())) turn();
  work_.disarm();
  publish_health();
}

}  // namespace v3d
