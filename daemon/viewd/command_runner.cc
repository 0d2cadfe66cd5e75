#include "daemon/viewd/command_runner.h"

#include <unistd.h>

#include "base/core/check.h"
#include "base/core/error.h"

namespace v3d {
namespace {

/// Time after the timeout of v3dctl, in which it takes its order back.
constexpr double kGraceSeconds = 15;

}  // namespace

CommandRunner::CommandRunner(const Studio& studio)
    : studio_(studio.path),
      v3dctl_(std::filesystem::read_symlink("/proc/self/exe").parent_path() / "v3dctl") {}

void CommandRunner::require_v3dctl() const {
  if (access(v3dctl_.c_str(), X_OK) == 0) return;
  throw InputError("viewer.control: " + errno_message(v3dctl_.string()) +
                   "; it executes orders of browsers; install the package v3d-tools");
}

void CommandRunner::start(const OperatorCommand& command, MonotonicInstant now) {
  V3D_CHECK(!program_);
  std::vector<std::string> arguments = {v3dctl_, "--studio", studio_};
  for (std::string& argument : command.arguments()) arguments.push_back(std::move(argument));
  program_.emplace(arguments, now + from_seconds(command.timeout_s() + kGraceSeconds));
}

std::optional<ProgramEnd> CommandRunner::poll(MonotonicInstant now) {
  if (!program_) return {};
  auto end = program_->poll(now);
  if (end) program_.reset();
  return end;
}

}  // namespace v3d
