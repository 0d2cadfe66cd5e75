#include "daemon/node_loop.h"

#include <spdlog/spdlog.h>

#include <algorithm>

#include "base/error.h"
#include "daemon/service.h"
#include "wire/channels.h"

namespace v3d {
namespace {

constexpr size_t kCommandQueue = 64;

}  // namespace

NodeLoop::NodeLoop(NodeIdentity identity, Bus& bus, NodeWork& work)
    : me_(std::move(identity)),
      bus_(bus),
      work_(work),
      controller_(me_.node),
      gate_(me_.node, me_.began),
      commands_(
          bus, kCommandChannel, kCommandQueue,
          [this](std::span<const uint8_t> bytes) { return gate_.admit(bytes, Realtime::now()); }),
      metrics_(serve_metrics(me_.metrics)),
      next_health_(Monotonic::now()),
      watchdog_(service::watchdog_period()),
      last_fed_(Monotonic::now()) {
  look_for_key();
}

void NodeLoop::look_for_key() {
  if (key_) return;
  try {
    key_ = StudioKey::load(me_.key);
    gate_.set_key(*key_);
    bus_.seal().set_key(*key_);
    if (!no_key_.empty()) spdlog::info("{}: commands are believed again", me_.key.string());
    no_key_.clear();
  } catch (const InputError& error) {
    const std::string problem = std::string("every command is refused: ") + error.what();
    if (problem != no_key_) spdlog::error("{}", problem);
    no_key_ = problem;
  }
}

void NodeLoop::run() {
  service::ready();
  spdlog::info("{} ready", me_.node);
  while (!stop_requested()) turn();
  service::stopping();
  shut_down();
}

void NodeLoop::turn() {
  if (const auto command = commands_.wait(next_turn())) {
    spdlog::debug("{} {} from {} #{}", name(command->verb), command->take, command->sender,
                  command->counter);
    carry_out(controller_.on_command(*command));
  }
  if (const auto report = work_.poll(controller_.phase())) {
    spdlog::info("{}", report->text);
    carry_out(controller_.on_event(report->event, report->text, report->detail));
  }
  let_go_what_nobody_confirms();
  rejoin_running_take();
  // Others act on a change of state; they shall not wait for it.
  if (Monotonic::now() >= next_health_ || controller_.phase() != told_phase_) publish_health();
  feed_watchdog();
}

void NodeLoop::let_go_what_nobody_confirms() {
  const MonotonicInstant now = Monotonic::now();
  if (controller_.phase() != Phase::kPrepared) {
    ready_since_ = now;
  } else if (now - ready_since_ > kConfirmWithin) {
    const std::string text = controller_.order().take + " was not confirmed in time: arm it again";
    spdlog::warn("{}", text);
    carry_out(controller_.on_event(Input::kExpired, text));
  }
}

void NodeLoop::rejoin_running_take() {
  // Whom nobody may command, believes nobody either.
  if (controller_.phase() != Phase::kIdle || !key_) return;
  try {
    if (const auto order = work_.rejoin()) controller_.rejoined(*order);
  } catch (const InputError& error) {
    spdlog::error("cannot go on with the take that runs: {}", error.what());
  }
}

MonotonicInstant NodeLoop::next_turn() const {
  const MonotonicInstant now = Monotonic::now();
  const bool idle = controller_.phase() == Phase::kIdle || controller_.phase() == Phase::kFault;
  Duration turn = idle ? kIdleTurn : kTurn;
  if (watchdog_) turn = std::min(turn, *watchdog_ / 4);
  return std::clamp(next_health_, now, now + turn);
}

void NodeLoop::carry_out(const Controller::Step& step) {
  // First the work, then the word: "done" is said of what is done.
  std::optional<Controller::Step> failure;
  try {
    begin(step.work);
  } catch (const InputError& error) {
    spdlog::warn("{}", error.what());
    failure = step.work == Work::kStart ? controller_.on_start_failed(error.what())
                                        : controller_.on_event(Input::kFailed, error.what());
  }
  if (!failure) return publish(step.replies);
  if (step.work != Work::kStart) publish(step.replies);
  carry_out(*failure);
}

void NodeLoop::publish(std::vector<ReplyMessage> replies) {
  // Who has no key has believed no command.
  if (!key_) return;
  for (ReplyMessage& reply : replies) {
    reply.sent = Realtime::now();
    bus_.publish(kReplyChannel, encode_sealed(reply, *key_));
  }
}

void NodeLoop::begin(Work work) {
  switch (work) {
    case Work::kNone:
      return;
    case Work::kArm:
      return work_.arm(controller_.order());
    case Work::kLearn:
      return work_.learn(controller_.order());
    case Work::kStart:
      return work_.start();
    case Work::kDrain:
      return work_.drain();
    case Work::kDisarm:
      return work_.disarm();
  }
}

void NodeLoop::publish_health() {
  next_health_ = Monotonic::now() + kHealthEvery;
  look_for_key();
  HealthMessage health;
  health.sent = Realtime::now();
  health.seq = health_seq_++;
  health.node = me_.node;
  health.program = me_.program;
  health.version = V3D_VERSION;
  told_phase_ = controller_.phase();
  health.state = node_state(told_phase_);
  health.take = controller_.phase() == Phase::kIdle ? std::string() : controller_.order().take;
  machine_.report(health.values);
  clock_.report(health.values);
  ptp_.report(health.values);
  work_.report_health(health);
  report_commands(health);
  if (controller_.phase() == Phase::kFault) health.text = controller_.fault();
  bus_.publish_sealed(health_channel(me_.node), encode(health));
  if (metrics_) metrics_->update(health);
  service::status(std::string(name(health.state)) + (health.take.empty() ? "" : " ") + health.take +
                  (health.text.empty() ? "" : ": ") + health.text);
}

void NodeLoop::report_commands(HealthMessage& health) const {
  const CommandCounts counts = gate_.counts();
  const auto value = [&](const char* name, int64_t n) {
    health.values[name] = static_cast<double>(n);
  };
  value("commands_received", counts.believed);
  value("commands_dropped", commands_.counts().dropped);
  value("commands_forged", counts.forged);
  value("commands_malformed", counts.malformed);
  value("commands_stale", counts.stale);
  value("commands_early", counts.early);
  value("commands_replayed", counts.replayed);
  value("commands_unkeyed", counts.unkeyed);
  const SealCounts messages = bus_.seal().counts();
  value("messages_forged", messages.forged);
  value("messages_stale", messages.stale);
  value("messages_replayed", messages.replayed);
  std::string trouble = key_ ? gate_.trouble(Realtime::now()) : no_key_;
  if (trouble.empty()) trouble = bus_.seal().trouble(Realtime::now());
  if (health.text.empty() || !key_) health.text = trouble;
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
  if (controller_.phase() == Phase::kRecording) {
    carry_out(controller_.on_event(Input::kTrainEnded, "the daemon was asked to stop"));
  }
  const MonotonicInstant deadline = Monotonic::now() + kLastDrain;
  while (controller_.phase() == Phase::kDraining && Monotonic::now() < deadline) turn();
  work_.disarm();
  publish_health();
}

}  // namespace v3d
