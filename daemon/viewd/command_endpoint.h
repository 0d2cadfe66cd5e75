// The HTTP endpoint for operators' commands: authorises and parses them, one at a time.
#pragma once

#include <deque>
#include <optional>
#include <string>

#include "base/config/studio_file.h"
#include "base/core/time.h"
#include "daemon/viewd/child_program.h"
#include "daemon/viewd/operator_command.h"
#include "daemon/viewd/token_throttle.h"
#include "daemon/web/web_message.h"
#include "wire/messages.h"

namespace v3d {

/// A command is a POST of JSON (parse_command()) by the page of this server, with the operators'
/// token in the field X-V3D-Operator. Pages of other origins cannot send this field without a CORS
/// preflight, and it appears in no address, history or log. An accepted command is answered at once
/// by 202 with its report. Its result is sent to all subscribers. The endpoint executes nothing
/// itself. Sender and result of each command are logged and reported as events. One thread.
class CommandEndpoint {
 public:
  /// With an empty token, every command is refused. `studio` must outlive this object.
  CommandEndpoint(const Studio& studio, std::string token);

  bool is_open() const { return !token_.empty(); }
  /// Does the request have the operators' token? False unless is_open().
  bool is_operator(const WebRequest& request) const;
  /// The answer to a GET: the report of the last command.
  WebAnswer report() const;
  /// The answer to a POST that WebAccess has allowed.
  WebAnswer post(const WebRequest& request, MonotonicInstant now);

  /// Removes and returns the accepted command that must be executed; empty if there is none.
  std::optional<OperatorCommand> next_command();
  /// The result of the command.
  void on_finished(const ProgramEnd& end);

  /// The report of the last command; its number is 0 if there was none.
  const CommandReport& last_report() const { return last_; }
  /// Removes and returns the next event for the studio page; empty if there is none.
  std::optional<EventMessage> next_event();

 private:
  std::optional<WebAnswer> refusal(const WebRequest& request, MonotonicInstant now);
  std::optional<WebAnswer> refusal_of_token(const WebRequest& request, MonotonicInstant now);
  void add_event(Severity severity, const std::string& text);

  const Studio& studio_;
  const std::string token_;
  TokenThrottle throttle_;
  CommandReport last_;
  std::optional<OperatorCommand> accepted_;  ///< not yet returned by next_command()
  std::deque<EventMessage> events_;
};

/// The operators' token; empty if viewer.control of the studio file is not true. Throws InputError
/// if the file is unsuitable, or if it holds `viewer_token`.
std::string load_operator_token(const Studio& studio, const std::string& viewer_token);

}  // namespace v3d
