// Runs v3dctl for operators' commands.
#pragma once

#include <filesystem>
#include <optional>

#include "base/config/studio_file.h"
#include "daemon/viewd/child_program.h"
#include "daemon/viewd/operator_command.h"

namespace v3d {

/// Starts one v3dctl process per command, with the studio file of this daemon. So a browser can do
/// what an operator can type, and only v3dctl signs commands. One command at a time. One thread.
class CommandRunner {
 public:
  explicit CommandRunner(const Studio& studio);

  /// Throws InputError if there is no v3dctl in the folder of this program.
  void require_v3dctl() const;

  /// Starts a command. Requires that none is running.
  void start(const OperatorCommand& command, MonotonicInstant now);
  /// Returns the result of the command once, when it has ended. Does not wait.
  std::optional<ProgramEnd> poll(MonotonicInstant now);

 private:
  const std::filesystem::path studio_;
  const std::filesystem::path v3dctl_;
  std::optional<ChildProgram> program_;
};

}  // namespace v3d
