#include "daemon/viewd/command_runner.h"

#include <unistd.h>

#include "base/check.h"
#include "base/error.h"

namespace v3d {
namespace {

/// Over what v3dctl takes to give up by itself: it takes back what it began.
constexpr double kOverPatienceSeconds = 15;

}  // namespace

CommandRunner::CommandRunner(const Studio& studio)
    : studio_(studio.path),
      v3dctl_(std::filesystem::read_symlink("/proc/self/exe").parent_path() / "v3dctl") {}

void CommandRunner::refuse_without_v3dctl() const {
  if (access(v3dctl_.c_str(), X_OK) == 0) return;
  throw InputError("viewer.control: " + errno_message(v3dctl_.string()) +
                   "; it carries out what browsers order, and comes with the package v3d-tools");
}

void CommandRunner::begin(const OperatorCommand& order, MonotonicInstant now) {
  V3D_CHECK(!program_);
  std::vector<std::string> words = {v3dctl_, "--studio", studio_};
  for (std::string& word : order.words()) words.push_back(std::move(word));
  program_.emplace(words, now + from_seconds(order.patience_s() + kOverPatienceSeconds));
}

std::optional<ProgramEnd> CommandRunner::poll(MonotonicInstant now) {
  if (!program_) return {};
  auto end = program_->poll(now);
  if (end) program_.reset();
  return end;
}

}  // namespace v3d
