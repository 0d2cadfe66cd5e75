#include "daemon/node_loop.h"

#include <spdlog/spdlog.h>

#include "base/error.h"
#include "daemon/service.h"
#include "wire/channels.h"

namespace v3d {
namespace {

constexpr size_t kCommandQueue = 64;

}  // namespace

NodeLoop::NodeLoop(std::string node, std::string program, Bus& bus, NodeWork& work)
    : node_(std::move(node)),
      program_(std::move(program)),
      bus_(bus),
      work_(work),
      controller_(node_),
      commands_(bus, kCommandChannel, kCommandQueue),
      next_health_(Monotonic::now()),
      watchdog_(service::watchdog_period()),
      last_fed_(Monotonic::now()) {}

void NodeLoop::run() {
  service::ready();
  spdlog::info("{} ready", node_);
  while (!stop_requested()) turn();
  service::stopping();
  shut_down();
}

void NodeLoop::turn() {
  if (const auto command = commands_.wait(Monotonic::now() + kTurn)) {
    spdlog::debug("{} {} from {} #{}", name(command->verb), command->take, command->sender,
                  command->counter);
    carry_out(controller_.on_command(*command));
  }
  if (const auto report = work_.poll(controller_.phase())) {
    spdlog::info("{}", report->text);
    carry_out(controller_.on_event(report->event, report->text, report->detail));
  }
  // Others act on a change of state; they shall not wait for it.
  if (Monotonic::now() >= next_health_ || controller_.phase() != told_phase_) publish_health();
  feed_watchdog();
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
  for (ReplyMessage& reply : replies) {
    reply.sent = Realtime::now();
    bus_.publish(kReplyChannel, encode(reply));
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
  HealthMessage health;
  health.sent = Realtime::now();
  health.seq = health_seq_++;
  health.node = node_;
  health.program = program_;
  health.version = V3D_VERSION;
  told_phase_ = controller_.phase();
  health.state = node_state(told_phase_);
  health.take = controller_.phase() == Phase::kIdle ? std::string() : controller_.order().take;
  const SubscriptionCounts commands = commands_.counts();
  health.values["commands_received"] = static_cast<double>(commands.received);
  health.values["commands_undecodable"] = static_cast<double>(commands.undecodable);
  health.values["commands_dropped"] = static_cast<double>(commands.dropped);
  machine_.report(health.values);
  clock_.report(health.values);
  work_.report_health(health);
  if (controller_.phase() == Phase::kFault) health.text = controller_.fault();
  bus_.publish(health_channel(node_), encode(health));
  service::status(std::string(name(health.state)) + (health.take.empty() ? "" : " ") + health.take +
                  (health.text.empty() ? "" : ": ") + health.text);
}

void NodeLoop::feed_watchdog() {
  if (!watchdog_ || Monotonic::now() - last_fed_ < *watchdog_ / 4) return;
  // A pipeline that stands still is not fed, and systemd starts the daemon again.
  if (!work_.progressed_since(Monotonic::now() - *watchdog_ / 2)) return;
  service::feed_watchdog();
  last_fed_ = Monotonic::now();
}

void NodeLoop::shut_down() {
  spdlog::info("{} stopping", node_);
  if (controller_.phase() == Phase::kRecording) {
    carry_out(controller_.on_event(Input::kTrainEnded, "the daemon was asked to stop"));
  }
  const MonotonicInstant deadline = Monotonic::now() + kLastDrain;
  while (controller_.phase() == Phase::kDraining && Monotonic::now() < deadline) turn();
  work_.disarm();
  publish_health();
}

}  // namespace v3d
