// What the main() of every daemon does: options, log, signals, errors to exit statuses.
#pragma once

#include <functional>
#include <string>

#include "base/studio_file.h"

namespace v3d {

struct DaemonProgram {
  std::string name;     ///< "v3d-captured"
  std::string purpose;  ///< one line for --help
  bool node_is_required = true;
};

/// `run(studio, node)` works until stop_requested(); `node` is empty where it may be and was left
/// out. Returns an ExitStatus; errors are one line on the log.
int daemon_main(int argc, char** argv, const DaemonProgram& program,
                const std::function<void(const Studio& studio, const std::string& node)>& run);

}  // namespace v3d
