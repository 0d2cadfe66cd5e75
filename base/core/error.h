// The three kinds of error:
//   - a bug: V3D_CHECK (base/core/check.h), which aborts in every build; only the inner loops of
//   kernels check in debug builds alone;
//   - bad input or set-up: InputError, thrown once with what, where and what would be right, caught
//   in main;
//   - while running (a drop, an unplug, a bad packet): data. Counted and shown, never thrown.
#pragma once

#include <stdexcept>
#include <string>

namespace v3d {

/// What a user can mend: a file, a field, an option. `what()` is one line. Programs exit with 2.
class InputError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// Exit statuses of every program of the project.
enum ExitStatus : int {
  kExitDone = 0,
  kExitFailed = 1,
  kExitBadInput = 2,
  kExitNotWhole = 3,  ///< done, but the result is incomplete or a check failed
};

/// "path: No such file or directory" for the current errno.
std::string errno_message(const std::string& what);

}  // namespace v3d
