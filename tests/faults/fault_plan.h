// Plan of the fault injector for this process, read from environment variables:
//   V3D_FAULT_PREFIX   faults and traces concern files at or below this absolute path only
//   V3D_FAULT_REPORT   file outside the prefix, sizeof(FaultReport) long (fault_report.h)
//   V3D_FAULT_CALL     family of calls that fails (kFaultCalls)
//   V3D_FAULT_NUMBER   which call of the family fails, from 1; 0: none, calls are counted only
//   V3D_FAULT_LASTS    1: every later call of the family fails too
//   V3D_FAULT_KIND     EIO, ENOSPC, EMFILE, ENOLCK, EINTR, SHORT (half of the bytes is
//                      transferred), or POWER_CUT (before the call, the ext4 file system of the
//                      prefix is shut down and the program is killed)
//   V3D_FAULT_PROGRAM  name of the program that gets the fault; empty: all programs
//   V3D_FAULT_TRACE    file outside the prefix: every change below the prefix is appended
//                      (fault_trace.h)
//   V3D_FAULT_MARKS    file outside the prefix: text written to it is recorded as marks in the
//                      trace; before a POWER_CUT the line kPowerCutMark is appended to it
#pragma once

#include <string>

#include "fault_report.h"

namespace v3d::test {

/// What happens to one call.
enum class FaultKind { kNone, kError, kShort, kPowerCut };

/// The plan; calls are counted in the shared FaultReport.
class FaultPlan {
 public:
  /// The plan of this process. Thread-safe.
  static FaultPlan& of_process();

  bool is_below(const std::string& path) const;
  bool is_marks(const std::string& path) const { return !marks_.empty() && path == marks_; }
  /// Counts one call on this file and returns its fault. With kPowerCut the process is killed.
  FaultKind next(std::string_view call, const std::string& path);
  /// The same, for calls on two names.
  FaultKind next(std::string_view call, const std::string& a, const std::string& b);
  int error() const { return error_; }

  bool traces() const { return trace_ >= 0; }
  int trace_fd() const { return trace_; }
  FaultReport* report() { return report_; }

 private:
  FaultPlan();
  bool is_hit(uint32_t number) const;

  std::string prefix_, marks_;
  FaultReport* report_ = nullptr;
  size_t call_ = kFaultCalls.size();
  uint32_t number_ = 0;
  bool lasts_ = false;
  FaultKind kind_ = FaultKind::kNone;
  int error_ = 0;
  int trace_ = -1;
};

/// The absolute path of `path`, links not resolved. A relative path starts at the folder `at`, or
/// at the working folder (AT_FDCWD).
std::string absolute_path(int at, const char* path);
/// The present path of the open file `fd`; empty when `fd` is not open, or has no path. Allocates
/// no memory for an eventfd: a signal handler may write to one while its thread allocates.
std::string path_of(int fd);

}  // namespace v3d::test
