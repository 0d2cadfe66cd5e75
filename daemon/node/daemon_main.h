// What the main() of every daemon does: options, log, signals, errors to exit statuses.
#pragma once

#include <functional>
#include <optional>
#include <string>

#include "base/studio_file.h"

namespace v3d {

/// A daemon works until it is asked to stop; an errand is done at once. `node` is empty where it
/// may be and was left out.
using DaemonWork = std::function<void(const Studio& studio, const std::string& node)>;

/// Another thing that the program does when it is called with the flag.
struct DaemonErrand {
  std::string flag;     ///< "--trigger-off"
  std::string purpose;  ///< one line for --help
  DaemonWork run;
};

struct DaemonProgram {
  std::string name;     ///< "v3d-captured"
  std::string purpose;  ///< one line for --help
  bool node_is_required = true;
  bool is_a_node = true;  ///< otherwise it knows no --node
  std::optional<DaemonErrand> errand = {};
};

/// Returns an ExitStatus; errors are one line on the log.
int daemon_main(int argc, char** argv, const DaemonProgram& program, const DaemonWork& run);

}  // namespace v3d
