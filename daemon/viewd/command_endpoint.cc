#include "daemon/viewd/command_endpoint.h"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "base/core/error.h"
#include "base/core/text.h"
#include "daemon/web/web_access.h"

namespace v3d::viewd {
namespace {

constexpr size_t kMaxEvents = 64;

web::WebResponse refused(const web::WebRequest& request, int status, const std::string& why) {
  spdlog::warn("refused an order from {}: {}", request.address, why);
  return web::plain_response(status, why);
}

bool is_json(const std::string& type) {
  return type == "application/json" || type.starts_with("application/json;");
}

/// Why the command comes too late; empty if it does not.
std::string lateness(const OperatorCommand& command) {
  if (!command.given) return "";
  const Duration age = Realtime::now() - *command.given;
  if (age <= CommandEndpoint::kMaxAge) return "";
  return "this order is " + std::to_string(std::llround(to_seconds(age))) +
         " s old and was not executed: check the state of the nodes, then send it again";
}

std::vector<std::string> split_lines(std::string_view text) {
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
  if (lines.empty()) lines = split_lines(end.errors);
  if (end.timed_out) {
    lines.emplace_back("v3dctl did not end in time and was stopped: see the nodes for the state");
  }
  return lines;
}

}  // namespace

CommandEndpoint::CommandEndpoint(const Studio& studio, std::string token)
    : studio_(studio), token_(std::move(token)) {}

bool CommandEndpoint::is_operator(const web::WebRequest& request) const {
  return is_open() && web::is_same_token(request.operator_token, token_);
}

web::WebResponse CommandEndpoint::report() const { return web::json_response(report_json(last_)); }

std::optional<web::WebResponse> CommandEndpoint::refusal_of_token(const web::WebRequest& request,
                                                                  MonotonicInstant now) {
  // Compare first: throttled wrong tokens of any address must never block the right token.
  if (web::is_same_token(request.operator_token, token_)) {
    throttle_.record_right(request.address);
    return {};
  }
  const Duration delay = throttle_.delay_for(request.address, now);
  if (delay > Duration::zero()) {
    const auto seconds = static_cast<int64_t>(std::ceil(to_seconds(delay)));
    web::WebResponse response = web::plain_response(
        429, "too many wrong tokens: try again in " + std::to_string(seconds) + " s");
    response.fields = {{"Retry-After", std::to_string(seconds)}};
    return response;
  }
  // A page that was not unlocked sends an empty token. This is not a wrong guess.
  if (!request.operator_token.empty()) throttle_.record_wrong(request.address, now);
  return refused(request, 401,
                 request.operator_token.empty() ? "orders require the operators' token"
                                                : "this is not the operators' token");
}

std::optional<web::WebResponse> CommandEndpoint::refusal(const web::WebRequest& request,
                                                         MonotonicInstant now) {
  if (!is_open()) {
    return refused(
        request, 403,
        "this studio accepts no orders from browsers: [viewer] control is not true in its "
        "studio file");
  }
  if (!web::WebAccess::is_own_page(request)) {
    return refused(request, 403, "orders from pages of other origins are refused");
  }
  if (!is_json(request.content_type)) {
    return refused(request, 415, "expected an order with Content-Type application/json");
  }
  if (request.has_unread_body) {
    return refused(request, 413, "expected an order of at most 4096 bytes with a Content-Length");
  }
  return refusal_of_token(request, now);
}

web::WebResponse CommandEndpoint::post(const web::WebRequest& request, MonotonicInstant now) {
  if (auto refusal = this->refusal(request, now)) return std::move(*refusal);
  const ParsedCommand parsed = parse_command(request.body, studio_);
  if (!parsed.command) return refused(request, 400, parsed.error);
  if (parsed.command->verb == OperatorCommand::Verb::kCheckToken) {
    add_event(wire::Severity::kInfo, request.address + " has the operators' token");
    return report();
  }
  if (const std::string late = lateness(*parsed.command); !late.empty()) {
    return refused(request, 409, late);
  }
  if (last_.is_running) {
    return refused(request, 409, last_.command.text() + " of " + last_.by + " is still running");
  }
  last_ = {.number = last_.number + 1,
           .by = request.address,
           .at = Realtime::now(),
           .command = *parsed.command,
           .is_running = true,
           .status = 0,
           .lines = {}};
  accepted_ = *parsed.command;
  add_event(wire::Severity::kInfo, last_.by + ": " + last_.command.text());
  web::WebResponse response = report();
  response.status = 202;
  return response;
}

std::optional<OperatorCommand> CommandEndpoint::next_command() {
  return std::exchange(accepted_, {});
}

void CommandEndpoint::on_finished(const ProgramEnd& end) {
  last_.is_running = false;
  last_.status = end.status;
  last_.lines = lines_of(end);
  const std::string last_line = last_.lines.empty() ? "" : ": " + last_.lines.back();
  const std::string summary = last_.by + ": " + last_.command.text();
  if (end.status == kExitDone)
    return add_event(wire::Severity::kInfo, summary + ": done" + last_line);
  add_event(wire::Severity::kWarning,
            summary + ": exit status " + std::to_string(end.status) + last_line);
}

void CommandEndpoint::add_event(wire::Severity severity, const std::string& text) {
  spdlog::log(severity == wire::Severity::kInfo ? spdlog::level::info : spdlog::level::warn,
              "operator at {}", text);
  if (events_.size() == kMaxEvents) events_.pop_front();
  events_.push_back({.sent = Realtime::now(),
                     .seq = 0,
                     .node = "v3d-viewd",
                     .severity = severity,
                     .subject = "operator",
                     .text = text});
}

std::optional<wire::EventMessage> CommandEndpoint::next_event() {
  if (events_.empty()) return {};
  wire::EventMessage event = std::move(events_.front());
  events_.pop_front();
  return event;
}

std::string load_operator_token(const Studio& studio, const std::string& viewer_token) {
  if (!studio.viewer.control) return "";
  std::string token = web::load_web_token(studio.viewer.operator_token, "viewer.operator_token");
  if (token != viewer_token) return token;
  throw InputError(
      studio.viewer.operator_token.string() +
      ": the same token as viewer.token, so that every viewer could send orders; use another");
}

const std::string& TokenThrottle::key_of(const std::string& address) const {
  static const std::string kOthers;
  const bool known = entries_.contains(address) || entries_.size() < kMaxAddresses;
  return known ? address : kOthers;
}

Duration TokenThrottle::delay_for(const std::string& address, MonotonicInstant now) const {
  const auto found = entries_.find(key_of(address));
  if (found == entries_.end()) return Duration::zero();
  constexpr int64_t kMaxDoublings = 6;
  const int64_t doublings = std::min(found->second.wrong - 1, kMaxDoublings);
  const Duration delay = std::min(kFirstDelay * (int64_t{1} << doublings), kMaxDelay);
  return std::max(Duration::zero(), found->second.last + delay - now);
}

void TokenThrottle::record_wrong(const std::string& address, MonotonicInstant now) {
  remove_old(now);
  Entry& entry = entries_[key_of(address)];
  ++entry.wrong;
  entry.last = now;
}

void TokenThrottle::record_right(const std::string& address) { entries_.erase(address); }

void TokenThrottle::remove_old(MonotonicInstant now) {
  std::erase_if(entries_,
                [&](const auto& entry) { return now - entry.second.last > kEntryLifetime; });
}

}  // namespace v3d::viewd
