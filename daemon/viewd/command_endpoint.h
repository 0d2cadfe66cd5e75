// Takes orders from the studio page: who may give one, and one at a time.
#pragma once

#include <deque>
#include <optional>
#include <string>

#include "base/studio_file.h"
#include "base/time.h"
#include "daemon/viewd/child_program.h"
#include "daemon/viewd/operator_command.h"
#include "daemon/viewd/token_throttle.h"
#include "daemon/viewd/web_message.h"
#include "wire/messages.h"

namespace v3d {

/// An order is a POST of JSON (read_order) from the page of this server with the operators' token
/// in the field X-V3D-Operator: a field that no other page can send unasked, and that is in no
/// address, history or log. What is taken is answered at once, 202 with its report; how it ends is
/// told to all who watch. The desk carries nothing out itself. What comes of an order, and whose it
/// was, is in the log and among the studio's events. One thread.
class CommandEndpoint {
 public:
  /// An empty token: the studio page only looks, and every order is refused. `studio` outlives it.
  CommandEndpoint(const Studio& studio, std::string token);

  bool is_open() const { return !token_.empty(); }
  /// Whether a request has the operators' token; false where the studio file lets no browser
  /// command.
  bool is_operator(const WebRequest& request) const;
  /// The report of the last order, to GET.
  WebAnswer report() const;
  /// The answer to a POST. WebAccess has let it in.
  WebAnswer take(const WebRequest& request, MonotonicInstant now);

  /// The order that was taken and is to be carried out, once.
  std::optional<OperatorCommand> next();
  /// How it ended.
  void finish(const ProgramEnd& end);

  /// Of the last order; its number is 0 as long as there was none.
  const CommandReport& last() const { return last_; }
  /// What the studio's events should tell of, once.
  std::optional<EventMessage> next_event();

 private:
  std::optional<WebAnswer> refusal(const WebRequest& request, MonotonicInstant now);
  std::optional<WebAnswer> refusal_of_token(const WebRequest& request, MonotonicInstant now);
  void tell(Severity severity, const std::string& text);

  const Studio& studio_;
  const std::string token_;
  TokenThrottle wrong_tokens_;
  CommandReport last_;
  std::optional<OperatorCommand> waiting_;
  std::deque<EventMessage> events_;
};

/// The operators' token, when the studio file lets browsers command; else empty. Throws InputError.
std::string load_operator_token(const Studio& studio, const std::string& viewer_token);

}  // namespace v3d
