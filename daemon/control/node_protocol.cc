#include "daemon/control/node_protocol.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <optional>
#include <utility>

#include "daemon/control/take_name.h"

namespace v3d::control {

NodeProtocol::NodeProtocol(std::string node, NodeDelegate& delegate, Reply reply,
                           MonotonicInstant now)
    : node_(std::move(node)),
      delegate_(delegate),
      reply_(std::move(reply)),
      controller_(node_),
      next_health_(now),
      prepared_since_(now) {}

void NodeProtocol::on_command(const wire::CommandMessage& command) {
  execute(controller_.on_command(command));
}

void NodeProtocol::poll(MonotonicInstant now, bool has_key) {
  if (const auto report = poll_delegate()) {
    spdlog::info("{}", report->text);
    execute(controller_.on_event(report->event, report->text, report->detail));
  }
  expire_uncommitted(now);
  if (has_key && controller_.may_rejoin()) rejoin_running_take();
}

std::optional<NodeReport> NodeProtocol::poll_delegate() {
  try {
    return delegate_.poll(controller_.phase());
  } catch (const std::exception& error) {
    return on_poll_error(error.what());
  }
}

/// A take that is being recorded continues: other threads write its frames.
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

MonotonicInstant NodeProtocol::next_poll(MonotonicInstant now) const {
  const bool idle = controller_.phase() == Phase::kIdle || controller_.phase() == Phase::kFault;
  return std::clamp(next_health_, now, now + (idle ? kIdlePollPeriod : kPollPeriod));
}

void NodeProtocol::expire_uncommitted(MonotonicInstant now) {
  if (controller_.phase() != Phase::kPrepared) {
    prepared_since_ = now;
  } else if (now - prepared_since_ > kCommitTimeout) {
    const std::string text = controller_.order().take + " was not committed in time: arm it again";
    spdlog::warn("{}", text);
    execute(controller_.on_event(Input::kExpired, text));
  }
}

void NodeProtocol::rejoin_running_take() {
  try {
    if (const auto order = delegate_.rejoin()) controller_.rejoined(*order);
  } catch (const std::exception& error) {
    spdlog::error("cannot rejoin the running take: {}", error.what());
  }
}

void NodeProtocol::execute(const Controller::Step& step) {
  // Work first, then replies: "done" must be true when it is sent.
  std::optional<Controller::Step> failure;
  try {
    perform(step.work);
  } catch (const std::exception& error) {
    spdlog::warn("{}", error.what());
    if (step.work == Work::kStart) failure = controller_.on_start_failed(error.what());
    // A failure to disarm is only logged: disarming is itself the reaction to failures.
    if (step.work != Work::kStart && step.work != Work::kDisarm) {
      failure = controller_.on_event(Input::kFailed, error.what());
    }
  }
  if (!failure) return publish(step.replies);
  if (step.work != Work::kStart) publish(step.replies);
  execute(*failure);
}

void NodeProtocol::publish(const std::vector<wire::ReplyMessage>& replies) const {
  for (const wire::ReplyMessage& reply : replies) reply_(reply);
}

void NodeProtocol::perform(Work work) {
  switch (work) {
    case Work::kNone:
      return;
    case Work::kArm:
      return delegate_.arm(controller_.order());
    case Work::kLearn:
      return delegate_.learn(controller_.order());
    case Work::kStart:
      return delegate_.start();
    case Work::kDrain:
      return delegate_.drain();
    case Work::kDisarm:
      return delegate_.disarm();
  }
}

bool NodeProtocol::is_health_due(MonotonicInstant now) const {
  return now >= next_health_ || controller_.phase() != reported_phase_;
}

wire::HealthMessage NodeProtocol::health(MonotonicInstant now) {
  next_health_ = now + kHealthPeriod;
  reported_phase_ = controller_.phase();
  wire::HealthMessage health;
  health.seq = health_seq_++;
  health.node = node_;
  health.state = node_state(reported_phase_);
  health.take = reported_phase_ == Phase::kIdle ? std::string() : controller_.order().take;
  delegate_.report_health(health);
  const bool is_busy = reported_phase_ != Phase::kIdle && reported_phase_ != Phase::kFault;
  if (is_busy && controller_.order().verb != wire::CommandVerb::kArm) {
    health.values[kUnrecordedFlag] = 1;
  }
  if (reported_phase_ == Phase::kFault) health.text = controller_.fault();
  return health;
}

void NodeProtocol::begin_shutdown(MonotonicInstant now) {
  shutdown_deadline_ = now + kShutdownDrain;
  if (controller_.phase() != Phase::kRecording) return;
  execute(controller_.on_event(Input::kTrainEnded, "the daemon received a stop signal"));
}

bool NodeProtocol::may_shut_down(MonotonicInstant now) const {
  return controller_.phase() != Phase::kDraining || now >= shutdown_deadline_;
}

}  // namespace v3d::control
