// status, arm, start, stop, abort and background: the operator's control of the studio.
#include <fmt/core.h>

#include <cstdio>
#include <nlohmann/json.hpp>

#include "base/core/error.h"
#include "base/core/text.h"
#include "common/console.h"
#include "common/option_checks.h"
#include "daemon/control/operator_client.h"
#include "daemon/control/take_name.h"
#include "take/take.h"
#include "v3dctl/command_line.h"
#include "v3dctl/operate/health_text.h"
#include "v3dctl/operate/reply_text.h"
#include "v3dctl/operate/studio_monitor.h"
#include "v3dctl/options.h"

namespace v3d::ctl {
namespace {

// Nodes report once a second. A node without a report in this time is silent.
constexpr double kHealthSeconds = 2.5;

MonotonicInstant in_seconds(double seconds) { return Monotonic::now() + from_seconds(seconds); }

/// Messages of a command: printed at once as text, or with --json in the end, as "lines" of the
/// object.
class Report {
 public:
  explicit Report(bool json) : json_(json) {}

  void add(const std::string& line) {
    lines_.push_back(line);
    if (!json_) std::printf("%s\n", line.c_str());
  }
  void add(const std::vector<std::string>& lines) {
    for (const std::string& line : lines) add(line);
  }
  /// Prints to stderr in both cases.
  void warn(const std::string& line) {
    lines_.push_back(line);
    std::fprintf(stderr, "%s\n", line.c_str());
  }
  void print(Json json) const {
    if (!json_) return;
    json["lines"] = lines_;
    std::printf("%s\n", json.dump(2).c_str());
  }
  bool json() const { return json_; }

 private:
  const bool json_;
  std::vector<std::string> lines_;
};

struct Options {
  bool json = false;
  bool wait = false;
  double timeout_s = 0;
  wire::CommandMessage message;
  std::string allow_missing;
};

// Sends a command and prints the replies of the nodes.
control::Answer send(control::OperatorClient& client, const Options& options, Report& report) {
  const auto show_progress = [&](const wire::ReplyMessage& reply) {
    if (reply.outcome == wire::ReplyMessage::Outcome::kPending && on_terminal()) {
      note(reply.node + ": " + reply.text);
    }
  };
  const control::Answer answer =
      client.command(options.message, in_seconds(options.timeout_s), show_progress);
  const bool quiet = answer.done() && options.message.verb != wire::CommandVerb::kArm;
  if (!quiet) {
    const bool arms = options.message.verb == wire::CommandVerb::kArm;
    std::map<std::string, wire::HealthMessage> health;
    if (!answer.silent.empty()) health = client.health(in_seconds(kHealthSeconds));
    report.add(reply_lines(client.nodes(), answer, arms ? "ready" : "done", health));
  }
  return answer;
}

int done_count(const control::Answer& answer) {
  int count = 0;
  for (const auto& [node, reply] : answer.replies) {
    count += reply.outcome == wire::ReplyMessage::Outcome::kDone;
  }
  return count;
}

// Reports a refusal. `json`: the object of --json, otherwise that of the answer.
int report_refusal(const control::OperatorClient& client, const control::Answer& answer,
                   const std::string& hint, Report& report, const Json& json = {}) {
  const bool asked_all = answer.replies.size() + answer.silent.size() == client.nodes().size();
  const std::string count = std::to_string(done_count(answer)) + " of " +
                            std::to_string(client.nodes().size()) + " nodes ready";
  report.warn("refused: " + (asked_all ? count + hint : "nothing was changed"));
  report.print(json.is_null() ? answer_json(answer) : json);
  return kExitFailed;
}

// The running take according to the nodes' health; "" when there is none.
std::string current_take(const std::map<std::string, wire::HealthMessage>& health) {
  for (const auto& [node, message] : health) {
    if (!message.take.empty()) return message.take;
  }
  return "";
}

// For commands whose result is only done or refused.
int run_simple(const CommandLine& line, const Options& options, const std::string& done_text) {
  control::OperatorClient client(line.studio());
  Report report(options.json);
  const control::Answer answer = send(client, options, report);
  if (!answer.done()) return report_refusal(client, answer, "", report);
  report.add(done_text);
  report.print(answer_json(answer));
  return kExitDone;
}

int run_arm(const CommandLine& line, Options options) {
  if (!is_file_name(options.message.take)) {
    throw InputError(
        "arm " + options.message.take +
        ": no take name; expected up to 64 letters, digits, '-', '_' and '.', not starting with "
        "'-' or '.'");
  }
  control::check_take_name(options.message.take);
  const Studio studio = line.studio();
  options.message.allow_missing = parse_names(options.allow_missing, "--allow-missing");
  for (const std::string& name : options.message.allow_missing) {
    const bool known = std::any_of(studio.cameras.begin(), studio.cameras.end(),
                                   [&](const StudioCamera& camera) { return camera.name == name; });
    if (!known)
      throw InputError("--allow-missing " + name + ": no such camera in " + studio.path.string());
  }
  control::OperatorClient client(studio);
  Report report(options.json);
  const control::Answer answer = send(client, options, report);
  if (!answer.done()) {
    return report_refusal(client, answer, " (arm without a camera: --allow-missing CAM)", report);
  }
  const double rate =
      options.message.rate_hz > 0 ? options.message.rate_hz : studio.trigger.rate_hz;
  report.add(fmt::format("armed {}: trigger {}, {:g} Hz", options.message.take, studio.trigger.node,
                         rate));
  report.print(answer_json(answer));
  return kExitDone;
}

/// Shows the progress until every node that is not silent has closed the take.
int wait_for_end(control::OperatorClient& client, const std::string& trigger_node) {
  StatusLine status;
  std::string take;
  TakeProgress progress(client.nodes(), trigger_node, Monotonic::now());
  catch_interrupts();
  for (;;) {
    stop_if_interrupted();
    const auto message = client.next_health(in_seconds(0.2));
    const MonotonicInstant now = Monotonic::now();
    if (message) progress.on_health(*message, now);
    const auto health = progress.health(now);
    if (const std::string current = current_take(health); !current.empty()) take = current;
    if (!take.empty()) status.show("recording " + take + "   " + recording_line(health));
    switch (progress.state(now)) {
      case TakeProgress::State::kRunning:
        continue;
      case TakeProgress::State::kEnded:
        return all_well(client.nodes(), health) ? kExitDone : kExitIncomplete;
      case TakeProgress::State::kTriggerIsSilent:
        note(fmt::format(
            "v3dctl: {}, which has the trigger, has not reported for {} s. Try: v3dctl status",
            trigger_node, to_seconds(TakeProgress::kSilentAfter)));
        return kExitFailed;
    }
  }
}

int run_start(const CommandLine& line, const Options& options) {
  const Studio studio = line.studio();
  control::OperatorClient client(studio);
  Report report(options.json);
  const control::Answer answer = send(client, options, report);
  if (!answer.done()) return report_refusal(client, answer, ": first v3dctl arm NAME", report);
  report.print(answer_json(answer));
  if (options.wait) return wait_for_end(client, studio.trigger.node);
  if (!options.json) {
    const auto health = client.health(in_seconds(kHealthSeconds));
    std::printf("recording %s   %s\n", current_take(health).c_str(),
                recording_line(health).c_str());
  }
  return kExitDone;
}

/// Seconds since the last pulse that this client received; null when it received none.
Json seconds_after_last_pulse(control::OperatorClient& client) {
  std::optional<RealtimeInstant> last;
  while (const auto pulse = client.next_pulse(Monotonic::now())) last = pulse->edge;
  return last ? Json(to_seconds(Realtime::now() - *last)) : Json();
}

int run_stop(const CommandLine& line, const Options& options) {
  const Studio studio = line.studio();
  control::OperatorClient client(studio);
  client.next_pulse(Monotonic::now());  // joins the channel of pulses
  Report report(options.json);
  const control::Answer answer = send(client, options, report);
  TakeAccount account = merge_ledgers(answer);
  // The cameras of a node without a reply, or without a ledger that can be read, miss every pulse.
  if (account.is_recorded() && !is_of_all_nodes(account, answer)) {
    account = merge_ledgers(answer, cameras_without_ledger(studio, account));
  }
  if (answer.done() || account.is_recorded()) report.add(account_lines(account));
  for (const std::string& node : account.unreadable) {
    report.warn("v3dctl: cannot read the ledger of " + node +
                ", which replied: " + answer.replies.at(node).text);
  }
  for (const std::string& node : account.of_another_take) {
    report.warn("v3dctl: " + node + " replied for another take; its part of " +
                account.ledger.take + " is on its disk: v3dctl takes");
  }
  Json json = answer_json(answer);
  json["take"] = account.ledger.take;
  json["verdict"] = account.ledger.verdict();
  json["ledger"] = to_json(account.ledger);
  json["live_lost"] = account.live_lost;
  if (!account.shards.empty()) json["shards"] = shards_json(account);
  if (report.json()) json["seconds_after_last_pulse"] = seconds_after_last_pulse(client);
  if (!answer.done()) return report_refusal(client, answer, "", report, json);
  report.print(std::move(json));
  return is_whole(account, answer) ? kExitDone : kExitIncomplete;
}

int run_status(const CommandLine& line, const Options& options) {
  control::OperatorClient client(line.studio());
  report_if_not_verified(client);
  const auto health = client.health(in_seconds(options.timeout_s));
  if (options.json) {
    std::printf("%s\n", health_json(client.nodes(), health).dump(2).c_str());
  } else {
    for (const std::string& text : status_lines(client.nodes(), health)) {
      std::printf("%s\n", text.c_str());
    }
    const std::string recording = recording_line(health);
    if (!current_take(health).empty() && !recording.empty()) std::printf("%s\n", recording.c_str());
  }
  return all_well(client.nodes(), health) ? kExitDone : kExitIncomplete;
}

std::shared_ptr<Options> options_of(cli::Command command, wire::CommandVerb verb,
                                    double timeout_s) {
  auto options = std::make_shared<Options>();
  options->message.verb = verb;
  options->timeout_s = timeout_s;
  add_json_flag(command, options->json);
  command.add_option("--timeout", options->timeout_s, "Give up after this many seconds")
      .type_name("S")
      .show_default()
      .check(cli::number_in(0.1, 3600));
  return options;
}

void add_arm(CommandLine& line) {
  cli::Command command =
      line.add("arm", "Prepare a take: cameras stream and wait for pulses",
               {"v3dctl arm kendo-07", "v3dctl arm kendo-08 --pulses 500 --allow-missing cam07"});
  auto options = options_of(command, wire::CommandVerb::kArm, 30);
  command.add_option("NAME", options->message.take, "The name of the take").required();
  command
      .add_option("--rate", options->message.rate_hz,
                  "Pulses per second (otherwise as in the studio file)")
      .type_name("HZ")
      .check(pulse_rate());
  command.add_option("--pulses", options->message.pulses, "End after N pulses (otherwise at stop)")
      .type_name("N")
      .check(cli::integer_in(1, take::kMaxPulses));
  command.add_option("--allow-missing", options->allow_missing, "Record also without these cameras")
      .type_name("CAM,...");
  line.on_run(command, [&line, options] { return run_arm(line, *options); });
}

}  // namespace

void add_operator_commands(CommandLine& line) {
  cli::Command status = line.add("status", "Print the state of every node", {"v3dctl status"});
  auto status_options = options_of(status, wire::CommandVerb::kArm, kHealthSeconds);
  line.on_run(status, [&line, status_options] { return run_status(line, *status_options); });

  add_arm(line);

  cli::Command start = line.add("start", "Start the pulses and record the armed take",
                                {"v3dctl start", "v3dctl start --wait"});
  auto start_options = options_of(start, wire::CommandVerb::kStart, 10);
  start.add_flag("--wait", start_options->wait,
                 "Show the progress until the take has ended (v3dctl arm --pulses)");
  line.on_run(start, [&line, start_options] { return run_start(line, *start_options); });

  cli::Command stop = line.add("stop", "End the take and reconcile its ledger",
                               {"v3dctl stop", "v3dctl stop --json"});
  auto stop_options = options_of(stop, wire::CommandVerb::kStop, 60);
  line.on_run(stop, [&line, stop_options] { return run_stop(line, *stop_options); });

  cli::Command abort =
      line.add("abort", "End arming or recording at once; files on disk stay", {"v3dctl abort"});
  auto abort_options = options_of(abort, wire::CommandVerb::kAbort, 10);
  line.on_run(abort,
              [&line, abort_options] { return run_simple(line, *abort_options, "aborted"); });

  cli::Command background = line.add("background", "Learn the background model of the empty studio",
                                     {"v3dctl background"});
  auto background_options = options_of(background, wire::CommandVerb::kBackground, 60);
  line.on_run(background, [&line, background_options] {
    return run_simple(line, *background_options, "background learned");
  });
}

}  // namespace v3d::ctl
