#include "daemon/viewd/command_endpoint.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "base/error.h"
#include "base/printable.h"
#include "daemon/viewd/web_access.h"

namespace v3d {
namespace {

constexpr size_t kMaxEvents = 64;

WebAnswer refused(const WebRequest& request, int status, const std::string& why) {
  spdlog::warn("an order from {} was refused: {}", request.address, why);
  return plain_answer(status, why);
}

bool is_json(const std::string& type) {
  return type == "application/json" || type.starts_with("application/json;");
}

std::vector<std::string> lines_in(std::string_view text) {
  std::vector<std::string> lines;
  while (!text.empty()) {
    const std::string_view line = text.substr(0, text.find('\n'));
    text.remove_prefix(std::min(text.size(), line.size() + 1));
    if (!line.empty()) lines.push_back(printable(line));
  }
  return lines;
}

std::vector<std::string> lines_of(const ProgramEnd& end) {
  std::vector<std::string> lines = lines_of_v3dctl(end.output);
  if (lines.empty()) lines = lines_in(end.errors);
  if (end.timed_out) {
    lines.emplace_back("v3dctl did not end in time and was stopped: the nodes tell how it stands");
  }
  return lines;
}

}  // namespace

CommandEndpoint::CommandEndpoint(const Studio& studio, std::string token)
    : studio_(studio), token_(std::move(token)) {}

bool CommandEndpoint::is_operator(const WebRequest& request) const {
  return is_open() && is_same_token(request.operator_token, token_);
}

WebAnswer CommandEndpoint::report() const { return json_answer(order_json(last_)); }

std::optional<WebAnswer> CommandEndpoint::refusal_of_token(const WebRequest& request,
                                                           MonotonicInstant now) {
  // Before anything else: wrong tokens, from whatever address, never keep the right one out.
  if (is_same_token(request.operator_token, token_)) {
    wrong_tokens_.right(request.address);
    return {};
  }
  const Duration pause = wrong_tokens_.pause_of(request.address, now);
  if (pause > Duration::zero()) {
    const auto seconds = static_cast<int64_t>(std::ceil(to_seconds(pause)));
    WebAnswer answer =
        plain_answer(429, "too many wrong tokens: try again in " + std::to_string(seconds) + " s");
    answer.fields = {{"Retry-After", std::to_string(seconds)}};
    return answer;
  }
  // An empty one is a page that was not unlocked, and no guess.
  if (!request.operator_token.empty()) wrong_tokens_.wrong(request.address, now);
  return refused(request, 401,
                 request.operator_token.empty() ? "orders want the operators' token"
                                                : "this is not the operators' token");
}

std::optional<WebAnswer> CommandEndpoint::refusal(const WebRequest& request, MonotonicInstant now) {
  if (!is_open()) {
    return refused(request, 403,
                   "this studio takes no orders from browsers: [viewer] control is not true in its "
                   "studio file");
  }
  if (!WebAccess::is_own_page(request)) {
    return refused(request, 403, "another page may not give orders");
  }
  if (!is_json(request.content_type)) {
    return refused(request, 415, "an order is sent as application/json");
  }
  if (request.has_unread_body) {
    return refused(request, 413, "an order is shorter than that, and says how long it is");
  }
  return refusal_of_token(request, now);
}

WebAnswer CommandEndpoint::take(const WebRequest& request, MonotonicInstant now) {
  if (auto refusal = this->refusal(request, now)) return std::move(*refusal);
  const ReadOrder read = read_order(request.body, studio_);
  if (!read.order) return refused(request, 400, read.wrong);
  if (read.order->verb == OperatorCommand::Verb::kLook) {
    tell(Severity::kInfo, request.address + " may command");
    return report();
  }
  if (last_.under_way) {
    return refused(request, 409, last_.order.text() + " of " + last_.by + " is still under way");
  }
  last_ = {.number = last_.number + 1,
           .by = request.address,
           .at = Realtime::now(),
           .order = *read.order,
           .under_way = true,
           .status = 0,
           .lines = {}};
  waiting_ = *read.order;
  tell(Severity::kInfo, last_.by + ": " + last_.order.text());
  WebAnswer answer = report();
  answer.status = 202;
  return answer;
}

std::optional<OperatorCommand> CommandEndpoint::next() { return std::exchange(waiting_, {}); }

void CommandEndpoint::finish(const ProgramEnd& end) {
  last_.under_way = false;
  last_.status = end.status;
  last_.lines = lines_of(end);
  const std::string said = last_.lines.empty() ? "" : ": " + last_.lines.back();
  const std::string what = last_.by + ": " + last_.order.text();
  if (end.status == kExitDone) return tell(Severity::kInfo, what + ": done" + said);
  tell(Severity::kWarning, what + ": exit status " + std::to_string(end.status) + said);
}

void CommandEndpoint::tell(Severity severity, const std::string& text) {
  spdlog::log(severity == Severity::kInfo ? spdlog::level::info : spdlog::level::warn,
              "operator at {}", text);
  if (events_.size() == kMaxEvents) events_.pop_front();
  events_.push_back({.sent = Realtime::now(),
                     .seq = 0,
                     .node = "v3d-viewd",
                     .severity = severity,
                     .subject = "operator",
                     .text = text});
}

std::optional<EventMessage> CommandEndpoint::next_event() {
  if (events_.empty()) return {};
  EventMessage event = std::move(events_.front());
  events_.pop_front();
  return event;
}

std::string load_operator_token(const Studio& studio, const std::string& viewer_token) {
  if (!studio.viewer.control) return "";
  std::string token = load_web_token(studio.viewer.operator_token, "viewer.operator_token");
  if (token != viewer_token) return token;
  throw InputError(studio.viewer.operator_token.string() +
                   ": the same token as viewer.token: whoever looks on could command");
}

}  // namespace v3d
