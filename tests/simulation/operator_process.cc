#include "simulation/operator_process.h"

#include <algorithm>
#include <utility>

namespace v3d::simulation {

OperatorProcess::OperatorProcess(World& world, Trace& trace, std::string name,
                                 control::CommandTargets studio)
    : world_(world), trace_(trace), name_(std::move(name)), studio_(std::move(studio)) {
  place_ =
      world_.network.join([](Channel channel, size_t) { return channel == Channel::kReply; },
                          [this](Channel, size_t, const wire::Bytes& bytes) { receive(bytes); });
}

void OperatorProcess::begin(std::deque<OperatorStep> steps) {
  steps_ = std::move(steps);
  all_done_ = true;
  answer_.reset();
  begin_next();
}

void OperatorProcess::kill() {
  if (!is_busy()) return;
  trace_.add([&] { return name_ + " is killed"; });
  steps_.clear();
  coordinator_.reset();
  all_done_ = false;
  ++plan_;
}

void OperatorProcess::begin_next() {
  if (steps_.empty()) return;
  const OperatorStep& step = steps_.front();
  stamp_.emplace(name_ + "@desk/" + std::to_string(++runs_));
  world_.truth.on_order(stamp_->sender(), step.order.verb);
  world_.truth.on_order_begins(stamp_->sender());
  world_.events.add_run(stamp_->sender(), step.order);
  trace_.add([&] {
    return stamp_->sender() + ": v3dctl " + std::string(name(step.order.verb)) + " " +
           step.order.take;
  });
  coordinator_.emplace(step.order, 0, studio_, world_.time.now() + step.timeout);
  poll();
}

/// Sends the due commands, as the loop of OperatorClient::command() does.
void OperatorProcess::poll() {
  while (coordinator_ && !coordinator_->is_finished()) {
    auto message = coordinator_->poll(world_.time.now());
    if (!message) break;
    stamp_->apply(*message, wall_clock(world_, clock_error_));
    world_.events.on_send(*message);
    world_.network.send(place_, Channel::kCommand, encode_with_mac(*message, world_.key));
  }
  if (coordinator_->is_finished()) return finish();
  world_.time.at(coordinator_->next_due(), [this, number = ++plan_] {
    if (number == plan_) poll();
  });
}

void OperatorProcess::receive(const wire::Bytes& bytes) {
  if (!coordinator_ || !world_.key.has_valid_mac(bytes)) return;
  const auto reply = wire::decode<wire::ReplyMessage>(bytes);
  if (!reply || reply->command_sender != stamp_->sender()) return;
  if (reply->command_counter == coordinator_->counter()) world_.events.on_receive(*reply);
  coordinator_->on_reply(*reply);
  poll();
}

void OperatorProcess::finish() {
  answer_ = coordinator_->answer();
  coordinator_.reset();
  ++plan_;
  trace_.add([&] {
    std::string text = stamp_->sender() + (answer_->done() ? ": done" : ": not done");
    for (const auto& [node, reply] : answer_->replies) text += "; " + node + ": " + reply.text;
    for (const std::string& node : answer_->silent) text += "; " + node + " is silent";
    return text;
  });
  const OperatorStep step = std::move(steps_.front());
  steps_.pop_front();
  world_.truth.on_answer(step.order, stamp_->sender(), 1, *answer_);
  all_done_ = all_done_ && answer_->done();
  if (steps_.empty()) return;
  world_.time.after(step.then, [this, number = ++plan_] {
    if (number == plan_) begin_next();
  });
}

}  // namespace v3d::simulation
