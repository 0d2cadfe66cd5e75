#include "daemon/viewd/operator_command.h"

#include <unistd.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <nlohmann/json.hpp>
#include <stdexcept>

#include "base/core/error.h"
#include "base/core/text.h"
#include "daemon/control/take_name.h"

namespace v3d::viewd {
namespace {

using Json = nlohmann::json;
using Verb = OperatorCommand::Verb;

constexpr double kMaxTakeSeconds = 24 * 3600;
constexpr double kMaxTimeMs = 9e12;  ///< its nanoseconds fit into 64 bits
constexpr int kMaxDepth = 4;
constexpr size_t kMaxLines = 200;

/// "look" is an older name of "check_token".
constexpr std::array<std::pair<std::string_view, Verb>, 6> kVerbs = {
    {{"check_token", Verb::kCheckToken},
     {"look", Verb::kCheckToken},
     {"arm", Verb::kArm},
     {"start", Verb::kStart},
     {"stop", Verb::kStop},
     {"abort", Verb::kAbort}}};

std::string_view verb_name(Verb verb) {
  return std::ranges::find(kVerbs, verb, [](const auto& entry) { return entry.second; })->first;
}

/// Why the JSON is not a command, for its sender.
struct CommandError : std::runtime_error {
  using std::runtime_error::runtime_error;
};

/// Discarded for text that is not JSON. Throws CommandError for JSON that is nested too deeply.
Json parsed(std::string_view text) {
  const auto shallow = [](int depth, Json::parse_event_t, Json&) {
    if (depth > kMaxDepth) throw CommandError("the JSON of an order is nested too deeply");
    return true;
  };
  return Json::parse(text, shallow, false);
}

Verb verb_of(const Json& json) {
  const auto found = json.find("do");
  if (found != json.end() && found->is_string()) {
    for (const auto& [name, verb] : kVerbs) {
      if (found->get_ref<const std::string&>() == name) return verb;
    }
  }
  throw CommandError("do: expected \"check_token\", \"arm\", \"start\", \"stop\" or \"abort\"");
}

std::string take_of(const Json& value) {
  if (!value.is_string() || !is_file_name(value.get_ref<const std::string&>())) {
    throw CommandError("take: not a valid name of a take: " + std::string(kFileNameRule));
  }
  try {
    control::check_take_name(value.get<std::string>());
  } catch (const InputError& error) {
    throw CommandError(std::string("take: ") + error.what());
  }
  return value;
}

int64_t pulses_of(const Json& value, const Studio& studio) {
  const double seconds = value.is_number() ? value.get<double>() : 0;
  if (!(seconds > 0 && seconds <= kMaxTakeSeconds)) {
    throw CommandError("seconds: expected more than 0 and no more than 86400, a day");
  }
  return std::max<int64_t>(1, std::llround(seconds * studio.trigger.rate_hz));
}

RealtimeInstant time_of(const Json& value) {
  const double ms = value.is_number() ? value.get<double>() : -1;
  if (!(ms >= 0 && ms <= kMaxTimeMs)) {
    throw CommandError("at_ms: expected milliseconds since 1970");
  }
  return from_ns<Realtime>(std::llround(ms) * 1'000'000);
}

std::vector<std::string> cameras_of(const Json& value, const Studio& studio) {
  if (!value.is_array()) throw CommandError("without: expected a list of cameras");
  std::vector<std::string> names;
  for (const Json& name : value) {
    const bool known = std::ranges::any_of(
        studio.cameras, [&](const StudioCamera& camera) { return name == camera.name; });
    if (!known) throw CommandError("without: expected names of cameras of this studio");
    names.push_back(name);
  }
  return names;
}

OperatorCommand command_of(const Json& json, const Studio& studio) {
  if (!json.is_object()) throw CommandError(R"(expected an order as JSON, such as {"do": "stop"})");
  OperatorCommand command;
  command.verb = verb_of(json);
  for (const auto& [key, value] : json.items()) {
    const bool is_arm = command.verb == Verb::kArm;
    if (key == "do") continue;
    if (key == "at_ms") {
      command.given = time_of(value);
    } else if (is_arm && key == "take") {
      command.take = take_of(value);
    } else if (is_arm && key == "seconds") {
      command.pulses = pulses_of(value, studio);
    } else if (is_arm && key == "without") {
      command.without = cameras_of(value, studio);
    } else {
      throw CommandError(printable(key) + ": not known to \"" +
                         std::string(verb_name(command.verb)) + "\"");
    }
  }
  if (command.verb == Verb::kArm && command.take.empty())
    throw CommandError("take: missing: the take's name");
  return command;
}

std::string listed(const std::vector<std::string>& names, const std::string& between) {
  std::string text;
  for (const std::string& name : names) text += (text.empty() ? "" : between) + name;
  return text;
}

}  // namespace

std::string OperatorCommand::text() const {
  std::string text(verb_name(verb));
  if (!take.empty()) text += " " + take;
  if (pulses > 0) text += ", " + std::to_string(pulses) + " pulses";
  if (!without.empty()) text += ", without " + listed(without, ", ");
  return text;
}

std::vector<std::string> OperatorCommand::arguments() const {
  std::vector<std::string> arguments = {std::string(verb_name(verb)), "--json", "--timeout",
                                        std::to_string(static_cast<int>(timeout_s()))};
  if (verb != Verb::kArm) return arguments;
  if (pulses > 0) arguments.insert(arguments.end(), {"--pulses", std::to_string(pulses)});
  if (!without.empty())
    arguments.insert(arguments.end(), {"--allow-missing", listed(without, ",")});
  arguments.push_back(take);
  return arguments;
}

double OperatorCommand::timeout_s() const {
  switch (verb) {
    case Verb::kArm:
      return 30;
    case Verb::kStop:
      return 60;
    default:
      return 10;
  }
}

ParsedCommand parse_command(std::string_view json, const Studio& studio) {
  try {
    return {.command = command_of(parsed(json), studio), .error = {}};
  } catch (const CommandError& error) {
    return {.command = {}, .error = error.what()};
  }
}

std::vector<std::string> lines_of_v3dctl(std::string_view json) {
  const Json output = Json::parse(json, nullptr, false);
  std::vector<std::string> lines;
  if (!output.is_object() || !output.contains("lines") || !output["lines"].is_array()) return lines;
  for (const Json& line : output["lines"]) {
    if (line.is_string() && lines.size() < kMaxLines)
      lines.push_back(printable(line.get_ref<const std::string&>()));
  }
  return lines;
}

std::string report_json(const CommandReport& report) {
  const Json json = {{"type", "order"},
                     {"number", report.number},
                     {"by", report.by},
                     {"at_ms", static_cast<double>(to_ns(report.at)) * 1e-6},
                     {"do", verb_name(report.command.verb)},
                     {"take", report.command.take},
                     {"text", report.command.text()},
                     {"under_way", report.is_running},
                     {"status", report.status},
                     {"lines", report.lines}};
  return json.dump(-1, ' ', false, Json::error_handler_t::replace);
}

namespace {

/// Time after the timeout of v3dctl, in which it takes its order back.
constexpr double kGraceSeconds = 15;

}  // namespace

CommandRunner::CommandRunner(const Studio& studio)
    : studio_(studio.path),
      v3dctl_(std::filesystem::read_symlink("/proc/self/exe").parent_path() / "v3dctl") {}

void CommandRunner::require_v3dctl() const {
  if (access(v3dctl_.c_str(), X_OK) == 0) return;
  throw InputError("viewer.control: " + errno_message(v3dctl_.string()) +
                   "; it executes orders of browsers; install the package v3d-tools");
}

void CommandRunner::start(const OperatorCommand& command, MonotonicInstant now) {
  V3D_CHECK(!program_);
  std::vector<std::string> arguments = {v3dctl_, "--studio", studio_};
  for (std::string& argument : command.arguments()) arguments.push_back(std::move(argument));
  program_.emplace(arguments, now + from_seconds(command.timeout_s() + kGraceSeconds));
}

std::optional<ProgramEnd> CommandRunner::poll(MonotonicInstant now) {
  if (!program_) return {};
  auto end = program_->poll(now);
  if (end) program_.reset();
  return end;
}

}  // namespace v3d::viewd
