// Carries orders out, by v3dctl.
#pragma once

#include <filesystem>
#include <optional>

#include "base/studio_file.h"
#include "daemon/viewd/child_program.h"
#include "daemon/viewd/operator_command.h"

namespace v3d {

/// Each order is a v3dctl of its own, with the studio file of this daemon: what a browser may do is
/// what an operator types, and v3dctl alone seals commands. One at a time. One thread.
class CommandRunner {
 public:
  explicit CommandRunner(const Studio& studio);

  /// Throws InputError where there is no v3dctl beside this program.
  void refuse_without_v3dctl() const;

  /// No other may be under way.
  void begin(const OperatorCommand& order, MonotonicInstant now);
  /// How the order ended, once; never waits.
  std::optional<ProgramEnd> poll(MonotonicInstant now);

 private:
  const std::filesystem::path studio_;
  const std::filesystem::path v3dctl_;
  std::optional<ChildProgram> program_;
};

}  // namespace v3d
