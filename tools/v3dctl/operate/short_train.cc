#include "v3dctl/operate/short_train.h"

#include <stdexcept>

#include "common/console.h"
#include "v3dctl/operate/health_text.h"
#include "v3dctl/operate/reply_text.h"

namespace v3d::ctl {
namespace {

constexpr char kCheckName[] = "check";
constexpr double kArmSeconds = 30;
constexpr double kStartSeconds = 10;
constexpr double kCloseSeconds = 30;

MonotonicInstant in_seconds(double seconds) { return Monotonic::now() + from_seconds(seconds); }

std::string name_of(const ShortTrain& train) {
  return train.take.empty() ? kCheckName : train.take;
}

control::Answer run_command(control::OperatorClient& client, wire::CommandVerb verb,
                            const ShortTrain& train, double timeout_s) {
  wire::CommandMessage message;
  message.verb = verb;
  message.take = name_of(train);
  message.rate_hz = train.rate_hz;
  message.pulses = train.pulses;
  control::Answer answer = client.command(message, in_seconds(timeout_s));
  if (answer.done()) return answer;
  std::string text = "refused";
  for (const std::string& line : reply_lines(client.nodes(), answer, "ready")) text += "\n" + line;
  throw std::runtime_error(text);
}

/// Waits until the trigger's node has closed the train, at most `seconds`.
void wait_for_end(control::OperatorClient& client, const std::string& trigger_node, double seconds,
                  const std::function<void()>& meanwhile) {
  for (const MonotonicInstant end = in_seconds(seconds); Monotonic::now() < end;) {
    stop_if_interrupted();
    meanwhile();
    client.next_health(in_seconds(0.05));
    const auto health = client.health(Monotonic::now());
    if (all_reported(client.nodes(), health) && !is_in_take(health.at(trigger_node))) return;
  }
}

}  // namespace

control::Answer run_train(control::OperatorClient& client, const Studio& studio,
                          const ShortTrain& train, const std::function<void()>& meanwhile) {
  run_command(client, train.take.empty() ? wire::CommandVerb::kCheck : wire::CommandVerb::kArm,
              train, kArmSeconds);
  try {
    run_command(client, wire::CommandVerb::kStart, train, kStartSeconds);
    const double rate = train.rate_hz > 0 ? train.rate_hz : studio.trigger.rate_hz;
    wait_for_end(client, studio.trigger.node,
                 static_cast<double>(train.pulses) / rate + kCloseSeconds, meanwhile);
    return run_command(client, wire::CommandVerb::kStop, train, kCloseSeconds);
  } catch (...) {
    wire::CommandMessage abort;
    abort.verb = wire::CommandVerb::kAbort;
    abort.take = name_of(train);
    abort.own_only = true;  // another operator may have armed a take meanwhile
    client.command(abort, in_seconds(kStartSeconds));
    throw;
  }
}

}  // namespace v3d::ctl
