// A service under systemd: readiness, status, watchdog, log, and the signal to stop. The adapter of
// libsystemd and spdlog's sinks. Does nothing harmful where there is no systemd.
#pragma once

#include <optional>
#include <string>

#include "base/time.h"

namespace v3d {

/// To the journal when it is there, else to stderr. `level`: trace, debug, info, warning, error.
/// Throws InputError for another level.
void begin_logging(const std::string& program, const std::string& level);

/// SIGTERM and SIGINT ask to stop from now on; call before threads begin.
void catch_stop_signals();
bool stop_requested();
/// Waits for that until `deadline`; true when it is so.
bool stop_requested_by(MonotonicInstant deadline);

namespace service {
void ready();
void stopping();
/// One line for `systemctl status`.
void status(const std::string& line);
void feed_watchdog();
/// How often the watchdog must be fed; empty when there is none.
std::optional<Duration> watchdog_period();
}  // namespace service

}  // namespace v3d
