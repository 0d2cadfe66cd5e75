// Common main() of the daemons: options, log, signals, and exit statuses for errors.
#pragma once

#include <functional>
#include <optional>
#include <string>

#include "base/config/studio_file.h"

namespace v3d {

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

}  // namespace v3d
