#include "daemon/node/node_loop.h"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <cmath>

#include "base/core/error.h"
#include "daemon/bus/channel_list.h"
#include "daemon/node/node_health.h"
#include "daemon/node/peer_health.h"
#include "daemon/node/service.h"
#include "wire/messages.h"

namespace v3d::node {
namespace {

constexpr size_t kCommandQueue = 64;

}  // namespace

NodeLoop::NodeLoop(NodeIdentity identity, bus::Bus& bus, control::NodeDelegate& delegate)
    : identity_(std::move(identity)),
      bus_(bus),
      delegate_(delegate),
      protocol_(
          identity_.node, delegate, [this](wire::ReplyMessage reply) { publish(std::move(reply)); },
          Monotonic::now()),
      filter_(identity_.node),
      files_(identity_.credentials, filter_.credentials(), bus.authenticator()),
      commands_(bus, wire::kCommandChannel, kCommandQueue,
                [this](const bus::ReceivedMessage& in) {
                  return filter_.admit(in.bytes, Monotonic::now());
                }),
      name_monitor_(bus, identity_.node),
      version_(version_with_appliance(V3D_VERSION)),
      metrics_(serve_metrics(identity_.metrics)),
      watchdog_(service::watchdog_period()),
      last_fed_(Monotonic::now()) {
  read_credentials();
}

void NodeLoop::read_credentials() {
  const std::string change = files_.poll(Monotonic::now());
  pass_on_signing_key();
  if (change.empty()) return;
  const std::string problem = credential_problem();
  if (problem.empty()) return spdlog::info("{}", change);
  spdlog::error("{}", problem);
}

void NodeLoop::pass_on_signing_key() {
  const std::optional<wire::SigningKey>& key = files_.signing_key();
  if (!key || key->public_key() == passed_key_) return;
  passed_key_ = key->public_key();
  delegate_.set_signing_key(*key);
}

std::string NodeLoop::credential_problem() const {
  return files_.is_ready() ? files_.problem() : "every command is rejected: " + files_.problem();
}

void NodeLoop::run() {
  service::ready();
  spdlog::info("{} ready", identity_.node);
  while (!stop_requested()) run_once();
  service::stopping();
  shut_down();
}

void NodeLoop::run_once() {
  if (const auto admitted = commands_.wait(next_deadline())) on_command(*admitted);
  // Before poll() may change the phase again: other nodes learn from kDraining that pulses ended.
  publish_due_health();
  // Without a key no command is accepted, and no message of other nodes is authentic.
  protocol_.poll(Monotonic::now(), files_.is_ready());
  publish_due_health();
  feed_watchdog();
}

void NodeLoop::on_command(const control::CommandReplayFilter::Admitted& admitted) {
  const wire::CommandMessage& command = admitted.command;
  spdlog::debug("{} {} from {} #{}", name(command.verb), command.take, command.sender,
                command.counter);
  if (may_mean_duplicate(command)) return;
  if (!admitted.is_current) return publish(filter_.nonce_reply(command, Monotonic::now()));
  if (!reject_for_duplicate_name(command)) protocol_.on_command(command);
}

/// Whether to send no reply: another process has this node's name and may have the take of this
/// command. This process has none, so its reply would say that nothing is recorded.
bool NodeLoop::may_mean_duplicate(const wire::CommandMessage& command) const {
  return !name_alarm_.empty() && !is_order(command.verb) && !protocol_.has_take_of(command);
}

/// Both processes with this name reject new orders. A running take continues, and can be stopped.
bool NodeLoop::reject_for_duplicate_name(const wire::CommandMessage& command) {
  if (name_alarm_.empty() || !is_order(command.verb)) return false;
  wire::ReplyMessage reply = filter_.nonce_reply(command, Monotonic::now());
  reply.outcome = wire::ReplyMessage::Outcome::kRefused;
  reply.text = name_alarm_;
  publish(std::move(reply));
  return true;
}

MonotonicInstant NodeLoop::next_deadline() const {
  const MonotonicInstant now = Monotonic::now();
  const MonotonicInstant next = protocol_.next_poll(now);
  return watchdog_ ? std::min(next, now + *watchdog_ / 4) : next;
}

void NodeLoop::publish(wire::ReplyMessage reply) {
  // Without a key no command was accepted, so there is nothing to reply to.
  if (!files_.is_ready()) return;
  const MonotonicInstant now = Monotonic::now();
  reply.nonce = filter_.nonce(now);
  reply.sent = Realtime::now();
  bus_.publish_reply(filter_.credentials().authenticate(encode(reply), now));
}

void NodeLoop::publish_due_health() {
  if (protocol_.is_health_due(Monotonic::now())) publish_health();
}

void NodeLoop::publish_health() {
  read_credentials();
  // Before the health, so that a revoked reconstruction node gets no key from now on.
  if (identity_.credentials.role == wire::Role::kCapture) bus_.announce_frame_key(identity_.node);
  wire::HealthMessage health = protocol_.health(Monotonic::now());
  check_clock(health);
  health.sent = Realtime::now();
  health.program = identity_.program;
  health.version = version_;
  machine_.report(health.values);
  clock_.report(health.values);
  ptp_.report(health.values);
  report_counts(health);
  report_problem(health);
  check_name(health);
  // For alerts: metrics have no text.
  health.values["problem_flag"] = health.text.empty() ? 0 : 1;
  if (is_stopping_) health.values[kStopping] = 1;
  if (metrics_) metrics_->update(health);
  publish_shortened(health);
  service::status(std::string(name(health.state)) + (health.take.empty() ? "" : " ") + health.take +
                  (health.text.empty() ? "" : ": ") + health.text);
}

void NodeLoop::publish_shortened(wire::HealthMessage& health) {
  const std::string channel = wire::health_channel(identity_.node);
  const bool has_key = bus_.authenticator().mac() != nullptr;
  shorten_health(health, bus::max_encoded_bytes(channel, has_key));
  bus_.publish_authenticated(channel, encode(health));
}

void NodeLoop::check_name(wire::HealthMessage& health) {
  name_monitor_.mark(health);
  const std::string alarm = name_monitor_.alarm(Monotonic::now());
  if (!alarm.empty() && name_alarm_.empty()) spdlog::error("{}", alarm);
  name_alarm_ = alarm;
  if (!alarm.empty() && health.state != wire::NodeState::kFault) health.text = alarm;
}

/// A take keeps the clock with which it began; a step of the clock is adopted when the node is
/// idle.
void NodeLoop::check_clock(wire::HealthMessage& health) {
  const Duration step = Realtime::step();
  health.values["clock_step_s"] = to_seconds(step);
  const bool is_new = std::chrono::abs(step - reported_step_) > RealtimeFollower::kSlew;
  reported_step_ = step;
  if (is_new && step != Duration::zero()) {
    ++clock_steps_;
    const bool is_back = step < Duration::zero();
    spdlog::warn("the clock was set {} by {:.1f} s; v3dctl doctor shows whether it is synchronised",
                 is_back ? "back" : "ahead", std::abs(to_seconds(step)));
  }
  health.values["clock_steps"] = static_cast<double>(clock_steps_);
  if (step == Duration::zero()) return;
  if (health.state == wire::NodeState::kIdle) {
    reported_step_ = {};
    return Realtime::adopt_step();
  }
  if (!health.text.empty()) return;
  health.text = fmt::format("the clock was set by {:+.1f} s; this take keeps the previous time",
                            to_seconds(step));
}

void NodeLoop::report_counts(wire::HealthMessage& health) const {
  const control::CommandCounts counts = filter_.counts();
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
  const bus::RejectionCounts messages = bus_.authenticator().counts();
  value("messages_forged", messages.forged);
  value("messages_unkeyed", messages.unkeyed);
  value("messages_unsigned", messages.not_signed);
  value("messages_stale", messages.stale);
  value("messages_replayed", messages.replayed);
  const bus::ReceptionCounts reception = bus_.reception();
  value("messages_incomplete", reception.datagrams.incomplete);
  value("datagrams_malformed", reception.datagrams.malformed);
  value("datagrams_foreign", reception.datagrams.foreign);
  value("datagrams_oversized", reception.datagrams.oversized);
  value("datagrams_dropped_by_kernel", reception.dropped_by_kernel);
}

void NodeLoop::report_problem(wire::HealthMessage& health) const {
  if (health.state == wire::NodeState::kFault) return;
  std::vector<std::string> problems = {health.text, credential_problem(),
                                       filter_.problem(Monotonic::now()),
                                       bus_.authenticator().trouble(Monotonic::now())};
  if (!files_.is_ready()) std::swap(problems[0], problems[1]);  // nothing works without credentials
  std::erase(problems, "");
  health.text = fmt::format("{}", fmt::join(problems, "; "));
}

void NodeLoop::feed_watchdog() {
  if (!watchdog_ || Monotonic::now() - last_fed_ < *watchdog_ / 4) return;
  // When the pipeline hangs, the watchdog is not fed, and systemd restarts the daemon.
  if (!delegate_.progressed_since(Monotonic::now() - *watchdog_ / 2)) return;
  service::feed_watchdog();
  last_fed_ = Monotonic::now();
}

void NodeLoop::shut_down() {
  spdlog::info("{} stopping", identity_.node);
  protocol_.begin_shutdown(Monotonic::now());
  while (!protocol_.may_shut_down(Monotonic::now())) run_once();
  delegate_.disarm();
  is_stopping_ = true;
  publish_health();
}

}  // namespace v3d::node
