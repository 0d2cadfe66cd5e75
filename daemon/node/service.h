// systemd service: readiness, status, watchdog, log and stop signals. Adapter of libsystemd and
// spdlog's sinks. Without systemd the notifications have no effect.
#pragma once

#include <optional>
#include <string>

#include "base/core/time.h"

namespace v3d {

/// Logs to the journal under systemd, else to stderr. `level`: trace, debug, info, warning, error
/// or off. Throws InputError for another level.
void start_logging(const std::string& program, const std::string& level);

/// From now on SIGTERM and SIGINT only set stop_requested(). Call before any thread starts.
void catch_stop_signals();
bool stop_requested();
/// Waits for a stop signal until `deadline`. True when there was one.
bool stop_requested_by(MonotonicInstant deadline);

namespace service {
void ready();
void stopping();
/// Sets the status line that `systemctl status` shows.
void status(const std::string& line);
void feed_watchdog();
/// The time within which the watchdog must be fed; empty without a watchdog.
std::optional<Duration> watchdog_period();
}  // namespace service

}  // namespace v3d
