// Common start of all daemons: main(), systemd service, watchdog.
#pragma once

#include <atomic>
#include <functional>
#include <optional>
#include <string>

#include "base/config/studio_file.h"
#include "base/core/time.h"

namespace v3d::node {

// systemd service: readiness, status, watchdog, log and stop signals. Adapter of libsystemd and
// spdlog's sinks. Without systemd the notifications have no effect.

/// Logs to the journal where systemd connected stderr with it, else to stderr. `level`: trace,
/// debug, info, warning, error or off. Throws InputError for another level.
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

/// Reports progress of the main thread to systemd. The watchdog then does not end a long start,
/// such as one that reads a take of hours, but ends one that hangs. One thread.
class WorkProgress {
 public:
  /// systemd waits this long for the next report, also where TimeoutStartSec is shorter.
  static constexpr Duration kMaxPause = std::chrono::minutes(15);

  /// Call often: once a second it feeds the watchdog, and extends the time for the start.
  void report(MonotonicInstant now = Monotonic::now());

 private:
  std::optional<MonotonicInstant> reported_;
};
}  // namespace service

// Common main() of the daemons: options, log, signals, and exit statuses for errors.

/// `node` is empty where the option is optional and was omitted.
using DaemonFunction = std::function<void(const Studio& studio, const std::string& node)>;

/// A flag that makes the program perform one action and exit, instead of running as a daemon.
struct DaemonOneShot {
  std::string flag;     ///< "--trigger-off"
  std::string purpose;  ///< one line for --help
  DaemonFunction run;
};

struct DaemonProgram {
  std::string name;     ///< "v3d-captured"
  std::string purpose;  ///< one line for --help
  bool node_is_required = true;
  bool is_a_node = true;  ///< false: the program has no option --node
  std::optional<DaemonOneShot> one_shot = {};
};

/// Parses the options and calls `run`, which returns when stop_requested(). Returns an ExitStatus;
/// exceptions become one line in the log.
int daemon_main(int argc, char** argv, const DaemonProgram& program, const DaemonFunction& run);

// Time of the last iteration of a thread's main loop. The watchdog is fed only while every thread
// of the pipeline iterates.

/// Any thread.
class Heartbeat {
 public:
  /// Call once per iteration.
  void beat() { last_ = to_ns(Monotonic::now()); }
  bool beat_since(MonotonicInstant t) const { return last_ >= to_ns(t); }

 private:
  std::atomic<int64_t> last_ = to_ns(Monotonic::now());
};

}  // namespace v3d::node
