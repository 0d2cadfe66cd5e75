// Starting programs; memory and scheduling of this process.
#pragma once

#include <sys/types.h>

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace v3d {

// Starts other programs without a shell (posix_spawn(3)), waits for them and kills them.
// (Boost.Process 1.74 forks, marks its pipes close-on-exec only after it has made them, and sets no
// signal masks.)

struct SpawnOptions {
  /// Descriptors that become standard input, output and error of the program; -1: /dev/null.
  /// Requires numbers above 2, or STDERR_FILENO for output and errors.
  int input = -1;
  int output = -1;
  int errors = -1;
  bool on_path = false;  ///< search the first word on the PATH; else it is a path
  /// Start with no signal blocked or ignored. Otherwise the program inherits the signals of this
  /// process, so that a job under nohup(1) stays one.
  bool default_signals = false;
  std::optional<std::vector<std::string>> environment = {};  ///< "NAME=value"; empty: inherited
};

/// Starts a program and returns its process id, or -1 with errno when it cannot be run. `words`:
/// its name and its arguments. The program inherits no other descriptor of this process.
/// Thread-safe.
pid_t spawn_process(const std::vector<std::string>& words, const SpawnOptions& options);

/// Exit status of the program: its own; 128 + the signal that ended it; 127 when the status is
/// unknown. wait_for_process() waits for the end; poll_process() returns an empty value while the
/// program runs.
int wait_for_process(pid_t child);
std::optional<int> poll_process(pid_t child);

/// Sends SIGKILL and waits for the end. Does nothing for -1.
void kill_process(pid_t child);

/// Replaces this process by the program at `path` (execv). `words`: its argv. Returns only on
/// failure, with errno.
void exec_program(const std::string& path, const std::vector<std::string>& words);

// The memory of this machine and of this process.

/// Memory that is available without swapping (MemAvailable of /proc/meminfo), bytes. INT64_MAX when
/// it is unknown.
int64_t available_memory();

/// Locks the memory of this process, current and future, where RLIMIT_MEMLOCK is unlimited. A
/// real-time thread then never waits for a page from a disk.
void lock_memory();

// Real-time scheduling and locked memory, for threads that do little work but must start it on
// time.

/// Parses a list of processors as the kernel writes it: "2-3,6". Empty for any other text.
std::vector<int> parse_processor_list(std::string_view text);

/// Task of a thread on isolated processors.
enum class IsolatedTask : uint8_t { kTrigger, kPackets };
/// The processors for a task, of those that the kernel keeps free of other work (isolcpus=): the
/// last one for the trigger, the others for receiving packets. Empty when none is left; the thread
/// then shares the other processors of the PC.
std::vector<int> processors_for(IsolatedTask task, std::vector<int> isolated);
/// Moves the calling thread to these processors of this PC. Has no effect without isolated
/// processors, or without permission.
void use_isolated_processors(IsolatedTask task);

/// Raises the scheduling priority of the calling thread, so that it runs as soon as it wakes. Moves
/// it to the isolated processor of the trigger, if there is one.
/// Uses real-time scheduling (SCHED_FIFO) where the process may (RLIMIT_RTPRIO). Otherwise it
/// requests the shortest time slice: Linux 6.12 and later schedule it before longer ones and need
/// no permission. On older kernels the request has no effect.
void make_thread_realtime();

/// Whether a thread of this process sleeps: it waits for an event and not for a processor.
/// `thread`: as of gettid(). True for a thread that has ended.
bool thread_sleeps(pid_t thread);

}  // namespace v3d
