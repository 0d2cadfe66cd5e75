// The three kinds of error:
// - a bug: V3D_CHECK (base/core/check.h) aborts in every build; the inner loops of kernels check in
//   debug builds only;
// - bad input or set-up: InputError, thrown once with what, where and what would be right, caught
//   in main;
// - a fault at run time (a dropped frame, an unplugged camera, a bad packet): data. It is counted
//   and shown, never thrown.
#pragma once

#include <stdexcept>
#include <string>

namespace v3d {

/// An error that a user can correct in a file, a field or an option. `what()` is one line. Programs
/// exit with status 2.
class InputError : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

/// Exit statuses of every program of the project.
enum ExitStatus : int {
  kExitDone = 0,
  kExitFailed = 1,
  kExitBadInput = 2,
  kExitIncomplete = 3,  ///< done, but the result is incomplete or a check failed
};

/// "`what`: <text of the current errno>", e.g. "path: No such file or directory".
std::string errno_message(const std::string& what);

}  // namespace v3d
