#include "daemon/control/node_protocol.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <optional>
#include <utility>

namespace v3d {

NodeProtocol::NodeProtocol(std::string node, NodeDelegate& work, Reply reply, MonotonicInstant now)
    : node_(std::move(node)),
      work_(work),
      reply_(std::move(reply)),
      controller_(node_),
      next_health_(now),
      ready_since_(now) {}

void NodeProtocol::on_command(const CommandMessage& command) {
  carry_out(controller_.on_command(command));
}

void NodeProtocol::poll(MonotonicInstant now, bool believes) {
  if (const auto report = poll_work()) {
    spdlog::info("{}", report->text);
    carry_out(controller_.on_event(report->event, report->text, report->detail));
  }
  let_go_what_nobody_confirms(now);
  if (believes && controller_.phase() == Phase::kIdle) rejoin_running_take();
}

std::optional<NodeReport> NodeProtocol::poll_work() {
  try {
    return work_.poll(controller_.phase());
  } catch (const std::exception& error) {
    return on_poll_error(error.what());
  }
}

/// A take that is recorded goes on: its frames are written by other threads.
std::optional<NodeReport> NodeProtocol::on_poll_error(const std::string& error) {
  const Phase phase = controller_.phase();
  if (phase == Phase::kRecording) {
    if (error != poll_error_) spdlog::error("while recording: {}", error);
    poll_error_ = error;
    return std::nullopt;
  }
  const Input event = phase == Phase::kDraining ? Input::kBroken : Input::kFailed;
  return NodeReport{.event = event, .text = error, .detail = {}};
}

MonotonicInstant NodeProtocol::next_turn(MonotonicInstant now) const {
  const bool idle = controller_.phase() == Phase::kIdle || controller_.phase() == Phase::kFault;
  return std::clamp(next_health_, now, now + (idle ? kIdleTurn : kTurn));
}

void NodeProtocol::let_go_what_nobody_confirms(MonotonicInstant now) {
  if (controller_.phase() != Phase::kPrepared) {
    ready_since_ = now;
  } else if (now - ready_since_ > kConfirmWithin) {
    const std::string text = controller_.order().take + " was not confirmed in time: arm it again";
    spdlog::warn("{}", text);
    carry_out(controller_.on_event(Input::kExpired, text));
  }
}

void NodeProtocol::rejoin_running_take() {
  try {
    if (const auto order = work_.rejoin()) controller_.rejoined(*order);
  } catch (const std::exception& error) {
    spdlog::error("cannot rejoin the running take: {}", error.what());
  }
}

void NodeProtocol::carry_out(const Controller::Step& step) {
  // First the work, then the word: "done" is said of what is done.
  std::optional<Controller::Step> failure;
  try {
    begin(step.work);
  } catch (const std::exception& error) {
    spdlog::warn("{}", error.what());
    if (step.work == Work::kStart) failure = controller_.on_start_failed(error.what());
    // Disarming is the answer to a failure; there is nothing to fall back to.
    if (step.work != Work::kStart && step.work != Work::kDisarm) {
      failure = controller_.on_event(Input::kFailed, error.what());
    }
  }
  if (!failure) return publish(step.replies);
  if (step.work != Work::kStart) publish(step.replies);
  carry_out(*failure);
}

void NodeProtocol::publish(const std::vector<ReplyMessage>& replies) const {
  for (const ReplyMessage& reply : replies) reply_(reply);
}

void NodeProtocol::begin(Work work) {
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

bool NodeProtocol::is_health_due(MonotonicInstant now) const {
  return now >= next_health_ || controller_.phase() != told_phase_;
}

HealthMessage NodeProtocol::health(MonotonicInstant now) {
  next_health_ = now + kHealthEvery;
  told_phase_ = controller_.phase();
  HealthMessage health;
  health.seq = health_seq_++;
  health.node = node_;
  health.state = node_state(told_phase_);
  health.take = told_phase_ == Phase::kIdle ? std::string() : controller_.order().take;
  work_.report_health(health);
  if (told_phase_ == Phase::kFault) health.text = controller_.fault();
  return health;
}

void NodeProtocol::begin_to_end(MonotonicInstant now) {
  end_by_ = now + kLastDrain;
  if (controller_.phase() != Phase::kRecording) return;
  carry_out(controller_.on_event(Input::kTrainEnded, "the daemon was asked to stop"));
}

bool NodeProtocol::may_end(MonotonicInstant now) const {
  return controller_.phase() != Phase::kDraining || now >= end_by_;
}

}  // namespace v3d
