// Errors of three kinds, and the assertions V3D_CHECK and V3D_DEBUG_CHECK.
#pragma once

#include <cassert>
#include <stdexcept>
#include <string>

namespace v3d {

// The three kinds of error:
// - a bug: V3D_CHECK aborts in every build; the inner loops of kernels check in
//   debug builds only;
// - bad input or set-up: InputError, thrown once with what, where and what would be right, caught
//   in main;
// - a fault at run time (a dropped frame, an unplugged camera, a bad packet): data. It is counted
//   and shown, never thrown.

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

// V3D_CHECK: assertions that stay active in every build.

/// Aborts with "FILE:LINE: check failed: CONDITION" on stderr when the condition is false.
/// Use it for preconditions and invariants, which only a bug can violate; never for input. Append
/// text with &&: V3D_CHECK(output_ && "arm() comes first").
#define V3D_CHECK(condition) \
  ((condition) ? static_cast<void>(0) : ::v3d::check_failed(#condition, __FILE__, __LINE__))

/// Like V3D_CHECK, in debug builds only: for the inner loops of kernels, where a branch costs time.
#define V3D_DEBUG_CHECK(condition) assert(condition)

namespace v3d {

[[noreturn, gnu::cold]] void check_failed(const char* condition, const char* file,
                                          int line) noexcept;

}  // namespace v3d
