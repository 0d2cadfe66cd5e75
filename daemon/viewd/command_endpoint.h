// Endpoint of operator commands, and the throttle of its token.
#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <map>
#include <optional>
#include <string>

#include "base/config/studio_file.h"
#include "base/core/time.h"
#include "base/io/child_process.h"
#include "daemon/viewd/operator_command.h"
#include "daemon/web/web_message.h"
#include "wire/messages.h"

namespace v3d::viewd {

// Throttle of wrong operators' tokens.

/// Limits the rate of wrong tokens by address. After a wrong token, further wrong ones of the same
/// address get 429 for 1 s, then for 2 s, 4 s and so on, up to a minute. A right token is never
/// delayed (CommandEndpoint compares first), and clears its address. Memory is bounded: beyond
/// kMaxAddresses, all further addresses share one entry. One thread.
class TokenThrottle {
 public:
  static constexpr size_t kMaxAddresses = 64;
  static constexpr Duration kFirstDelay = std::chrono::seconds(1);
  static constexpr Duration kMaxDelay = std::chrono::minutes(1);
  /// An address is forgotten after this time without a wrong token.
  static constexpr Duration kEntryLifetime = std::chrono::minutes(10);

  /// How long from `now` a wrong token of this address gets 429; zero: it gets 401.
  Duration delay_for(const std::string& address, MonotonicInstant now) const;
  void record_wrong(const std::string& address, MonotonicInstant now);
  void record_right(const std::string& address);

 private:
  struct Entry {
    int64_t wrong = 0;
    MonotonicInstant last;
  };
  const std::string& key_of(const std::string& address) const;
  void remove_old(MonotonicInstant now);

  std::map<std::string, Entry> entries_;
};

// The HTTP endpoint for operators' commands: authorises and parses them, one at a time.

/// A command is a POST of JSON (parse_command()) by the page of this server, with the operators'
/// token in the field X-V3D-Operator. Pages of other origins cannot send this field without a CORS
/// preflight, and it appears in no address, history or log. An accepted command is answered at once
/// by 202 with its report. Its result is sent to all subscribers. The endpoint executes nothing
/// itself. Sender and result of each command are logged and reported as events. One thread.
class CommandEndpoint {
 public:
  /// An older command was delayed by the network, and its sender may not want it any more.
  static constexpr Duration kMaxAge = std::chrono::seconds(10);

  /// With an empty token, every command is refused. `studio` must outlive this object.
  CommandEndpoint(const Studio& studio, std::string token);

  bool is_open() const { return !token_.empty(); }
  /// Does the request have the operators' token? False unless is_open().
  bool is_operator(const web::WebRequest& request) const;
  /// The response to a GET: the report of the last command.
  web::WebResponse report() const;
  /// The response to a POST that WebAccess has allowed.
  web::WebResponse post(const web::WebRequest& request, MonotonicInstant now);

  /// Removes and returns the accepted command that must be executed; empty if there is none.
  std::optional<OperatorCommand> next_command();
  /// The result of the command.
  void on_finished(const ProgramEnd& end);

  /// The report of the last command; its number is 0 if there was none.
  const CommandReport& last_report() const { return last_; }
  /// Removes and returns the next event for the studio page; empty if there is none.
  std::optional<wire::EventMessage> next_event();

 private:
  std::optional<web::WebResponse> refusal(const web::WebRequest& request, MonotonicInstant now);
  std::optional<web::WebResponse> refusal_of_token(const web::WebRequest& request,
                                                   MonotonicInstant now);
  void add_event(wire::Severity severity, const std::string& text);

  const Studio& studio_;
  const std::string token_;
  TokenThrottle throttle_;
  CommandReport last_;
  std::optional<OperatorCommand> accepted_;  ///< not yet returned by next_command()
  std::deque<wire::EventMessage> events_;
};

/// The operators' token; empty if viewer.control of the studio file is not true. Throws InputError
/// if the file is unsuitable, or if it holds `viewer_token`.
std::string load_operator_token(const Studio& studio, const std::string& viewer_token);

}  // namespace v3d::viewd
