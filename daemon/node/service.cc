#include "daemon/node/service.h"

#include <malloc.h>
#include <poll.h>
#include <spdlog/sinks/stdout_color_sinks.h>
#include <spdlog/sinks/systemd_sink.h>
#include <spdlog/spdlog.h>
#include <sys/eventfd.h>
#include <sys/stat.h>
#include <systemd/sd-daemon.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <climits>
#include <csignal>
#include <cstdlib>
#include <optional>
#include <string>

#include "base/core/error.h"
#include "cli/command.h"

namespace v3d::node {
namespace {

/// Atomic: the signal may interrupt any thread.
std::atomic<bool> g_stop_requested = false;
static_assert(std::atomic<bool>::is_always_lock_free, "a signal handler must not wait");
int g_stop_event = -1;  ///< eventfd: readable after a stop signal, in any thread

void on_stop_signal(int) {
  const int error = errno;
  g_stop_requested = true;
  const uint64_t one = 1;
  [[maybe_unused]] const ssize_t written = write(g_stop_event, &one, sizeof(one));
  errno = error;
}

/// Whether systemd connected stderr with the journal. A program that a service runs with another
/// stderr inherits $JOURNAL_STREAM, so the variable must name this stderr (systemd.exec(5)).
bool stderr_is_the_journal() {
  const char* const stream = std::getenv("JOURNAL_STREAM");
  struct stat state {};
  if (stream == nullptr || fstat(STDERR_FILENO, &state) != 0) return false;
  return stream == std::to_string(state.st_dev) + ":" + std::to_string(state.st_ino);
}

}  // namespace

void start_logging(const std::string& program, const std::string& level) {
  const auto parsed = spdlog::level::from_str(level);
  if (parsed == spdlog::level::off && level != "off") {
    throw InputError("--log-level: '" + level +
                     "' is not one of trace, debug, info, warning, error, off");
  }
  const bool under_systemd = stderr_is_the_journal();
  auto log = under_systemd ? spdlog::systemd_logger_mt(program) : spdlog::stderr_color_mt(program);
  if (!under_systemd) log->set_pattern("%H:%M:%S.%e %n %^%l%$ %v");
  log->set_level(parsed);
  log->flush_on(spdlog::level::info);
  spdlog::set_default_logger(std::move(log));
}

void catch_stop_signals() {
  g_stop_event = eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK);
  struct sigaction action {};
  action.sa_handler = on_stop_signal;
  sigaction(SIGTERM, &action, nullptr);
  sigaction(SIGINT, &action, nullptr);
  std::signal(SIGPIPE, SIG_IGN);
}

bool stop_requested() { return g_stop_requested; }

bool stop_requested_by(MonotonicInstant deadline) {
  while (!stop_requested()) {
    const auto left = std::chrono::ceil<std::chrono::milliseconds>(deadline - Monotonic::now());
    if (left.count() <= 0) return false;
    pollfd event{g_stop_event, POLLIN, 0};
    poll(&event, 1, static_cast<int>(std::min<int64_t>(left.count(), INT_MAX)));
  }
  return true;
}

namespace service {

void ready() { sd_notify(0, "READY=1"); }
void stopping() { sd_notify(0, "STOPPING=1"); }
void status(const std::string& line) { sd_notify(0, ("STATUS=" + line).c_str()); }
void feed_watchdog() { sd_notify(0, "WATCHDOG=1"); }

std::optional<Duration> watchdog_period() {
  uint64_t microseconds = 0;
  if (sd_watchdog_enabled(0, &microseconds) <= 0) return std::nullopt;
  return std::chrono::microseconds(microseconds);
}

void WorkProgress::report(MonotonicInstant now) {
  if (reported_ && now - *reported_ < std::chrono::seconds(1)) return;
  reported_ = now;
  constexpr auto kExtension = std::chrono::duration_cast<std::chrono::microseconds>(kMaxPause);
  sd_notify(0, ("WATCHDOG=1\nEXTEND_TIMEOUT_USEC=" + std::to_string(kExtension.count())).c_str());
}

}  // namespace service

namespace {

/// Images are allocated and freed hundreds of times per second. By default malloc would return the
/// memory of each to the kernel and fault it in again, page by page. Keep up to 256 MiB instead.
void keep_freed_memory() {
  constexpr int kLargestKept = 32 << 20;
  constexpr int kKept = 256 << 20;
  mallopt(M_MMAP_THRESHOLD, kLargestKept);
  mallopt(M_TRIM_THRESHOLD, kKept);
}

}  // namespace

int daemon_main(int argc, char** argv, const DaemonProgram& program, const DaemonFunction& run) {
  cli::Program app{program.purpose, program.name};
  std::filesystem::path studio;
  std::string node;
  std::string log_level = "info";
  app.add_version(V3D_VERSION);
  app.add_option("--studio", studio, "the studio file").required().type_name("studio.toml");
  if (program.is_a_node) {
    app.add_option("--node", node, "name of the [[node]] of this process in the studio file")
        .required(program.node_is_required)
        .type_name("NAME");
  }
  app.add_option("--log-level", log_level, "trace, debug, info, warning, error or off")
      .show_default();
  bool one_shot = false;
  if (program.one_shot) app.add_flag(program.one_shot->flag, one_shot, program.one_shot->purpose);
  if (const std::optional<int> status = app.parse_or_report(argc, argv)) {
    return *status <= kExitFailed ? *status : kExitBadInput;  // 1: the help could not be written
  }
  keep_freed_memory();
  try {
    start_logging(program.name, log_level);
    if (one_shot) {
      program.one_shot->run(load_studio(studio), node);
      return kExitDone;
    }
    catch_stop_signals();
    run(load_studio(studio), node);
    return kExitDone;
  } catch (const InputError& error) {
    spdlog::critical("{}", error.what());
    return kExitBadInput;
  } catch (const std::exception& error) {
    spdlog::critical("{}", error.what());
    return kExitFailed;
  }
}

}  // namespace v3d::node
