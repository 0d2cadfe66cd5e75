// Other programs: started without a shell by posix_spawn(3), waited for, killed. (Boost.Process
// 1.74 forks, marks its pipes close-on-exec only after they are made, and sets no signal masks.)
#pragma once

#include <sys/types.h>

#include <optional>
#include <string>
#include <vector>

namespace v3d {

struct SpawnOptions {
  /// Descriptors that become its standard input, output and error; -1: /dev/null. Requires numbers
  /// above 2, or STDERR_FILENO for output and errors.
  int input = -1;
  int output = -1;
  int errors = -1;
  bool on_path = false;  ///< the first word is looked for on the PATH; else it is a path
  /// No signal is blocked or ignored; else as in this process: a job that nohup(1) started stays
  /// one.
  bool default_signals = false;
  std::optional<std::vector<std::string>> environment = {};  ///< "NAME=value"; empty: as ours
};

/// Starts a program. `words`: its name and its arguments. No other descriptor of this process is
/// open in it. Returns its process id, or -1 with errno when it cannot be run. Any thread.
pid_t spawn_process(const std::vector<std::string>& words, const SpawnOptions& options);

/// Its exit status once it has ended; 128 + the signal when one ended it; 127 when nothing is known
/// of it. The first waits, the second is empty while it runs.
int wait_for_process(pid_t child);
std::optional<int> poll_process(pid_t child);

/// SIGKILL, and waits for the end. Nothing for -1.
void kill_process(pid_t child);

/// This process becomes the program at `path`; `words`: as main() gets them. Returns, with errno,
/// only when it cannot.
void become_program(const std::string& path, const std::vector<std::string>& words);

}  // namespace v3d
