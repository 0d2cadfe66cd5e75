#include "daemon/viewd/operator_command.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <nlohmann/json.hpp>
#include <stdexcept>

#include "base/name.h"
#include "base/printable.h"

namespace v3d {
namespace {

using Json = nlohmann::json;
using Verb = OperatorCommand::Verb;

constexpr double kLongestTakeSeconds = 24 * 3600;
constexpr int kDeepest = 4;
constexpr size_t kMaxLines = 200;

constexpr std::array<std::pair<std::string_view, Verb>, 5> kVerbs = {{{"look", Verb::kLook},
                                                                      {"arm", Verb::kArm},
                                                                      {"start", Verb::kStart},
                                                                      {"stop", Verb::kStop},
                                                                      {"abort", Verb::kAbort}}};

std::string_view word(Verb verb) {
  return std::ranges::find(kVerbs, verb, [](const auto& entry) { return entry.second; })->first;
}

/// What is wrong with an order, for who sent it.
struct Wrong : std::runtime_error {
  using std::runtime_error::runtime_error;
};

/// Nothing for what is no JSON, or JSON that no order looks like.
Json parsed(std::string_view text) {
  const auto shallow = [](int depth, Json::parse_event_t, Json&) {
    if (depth > kDeepest) throw Wrong("an order is not as deep as that");
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
  throw Wrong("do: expected \"look\", \"arm\", \"start\", \"stop\" or \"abort\"");
}

std::string take_of(const Json& value) {
  if (value.is_string() && is_file_name(value.get_ref<const std::string&>())) return value;
  throw Wrong("take: no name of a take: " + std::string(kFileNameRule));
}

int64_t pulses_of(const Json& value, const Studio& studio) {
  const double seconds = value.is_number() ? value.get<double>() : 0;
  if (!(seconds > 0 && seconds <= kLongestTakeSeconds)) {
    throw Wrong("seconds: expected more than 0 and no more than 86400, a day");
  }
  return std::max<int64_t>(1, std::llround(seconds * studio.trigger.rate_hz));
}

std::vector<std::string> cameras_of(const Json& value, const Studio& studio) {
  if (!value.is_array()) throw Wrong("without: expected a list of cameras");
  std::vector<std::string> names;
  for (const Json& name : value) {
    const bool known = std::ranges::any_of(
        studio.cameras, [&](const StudioCamera& camera) { return name == camera.name; });
    if (!known) throw Wrong("without: expected names of cameras of this studio");
    names.push_back(name);
  }
  return names;
}

OperatorCommand order_of(const Json& json, const Studio& studio) {
  if (!json.is_object()) throw Wrong(R"(expected an order as JSON, such as {"do": "stop"})");
  OperatorCommand order;
  order.verb = verb_of(json);
  for (const auto& [key, value] : json.items()) {
    const bool arms = order.verb == Verb::kArm;
    if (key == "do") continue;
    if (arms && key == "take") {
      order.take = take_of(value);
    } else if (arms && key == "seconds") {
      order.pulses = pulses_of(value, studio);
    } else if (arms && key == "without") {
      order.without = cameras_of(value, studio);
    } else {
      throw Wrong(printable(key) + ": not known to \"" + std::string(word(order.verb)) + "\"");
    }
  }
  if (order.verb == Verb::kArm && order.take.empty()) throw Wrong("take: missing: the take's name");
  return order;
}

std::string listed(const std::vector<std::string>& names, const std::string& between) {
  std::string text;
  for (const std::string& name : names) text += (text.empty() ? "" : between) + name;
  return text;
}

}  // namespace

std::string OperatorCommand::text() const {
  std::string text(word(verb));
  if (!take.empty()) text += " " + take;
  if (pulses > 0) text += ", " + std::to_string(pulses) + " pulses";
  if (!without.empty()) text += ", without " + listed(without, ", ");
  return text;
}

std::vector<std::string> OperatorCommand::words() const {
  std::vector<std::string> words = {std::string(word(verb)), "--json", "--timeout",
                                    std::to_string(static_cast<int>(patience_s()))};
  if (verb != Verb::kArm) return words;
  if (pulses > 0) words.insert(words.end(), {"--pulses", std::to_string(pulses)});
  if (!without.empty()) words.insert(words.end(), {"--allow-missing", listed(without, ",")});
  words.push_back(take);
  return words;
}

double OperatorCommand::patience_s() const {
  switch (verb) {
    case Verb::kArm:
      return 30;
    case Verb::kStop:
      return 60;
    default:
      return 10;
  }
}

ReadOrder read_order(std::string_view json, const Studio& studio) {
  try {
    return {.order = order_of(parsed(json), studio), .wrong = {}};
  } catch (const Wrong& wrong) {
    return {.order = {}, .wrong = wrong.what()};
  }
}

std::vector<std::string> lines_of_v3dctl(std::string_view json) {
  const Json said = Json::parse(json, nullptr, false);
  std::vector<std::string> lines;
  if (!said.is_object() || !said.contains("lines") || !said["lines"].is_array()) return lines;
  for (const Json& line : said["lines"]) {
    if (line.is_string() && lines.size() < kMaxLines)
      lines.push_back(printable(line.get_ref<const std::string&>()));
  }
  return lines;
}

std::string order_json(const CommandReport& report) {
  const Json json = {{"type", "order"},
                     {"number", report.number},
                     {"by", report.by},
                     {"at_ms", static_cast<double>(to_ns(report.at)) * 1e-6},
                     {"do", word(report.order.verb)},
                     {"take", report.order.take},
                     {"text", report.order.text()},
                     {"under_way", report.under_way},
                     {"status", report.status},
                     {"lines", report.lines}};
  return json.dump(-1, ' ', false, Json::error_handler_t::replace);
}

}  // namespace v3d
