// What the fault injector does in this process, read from the environment:
//   V3D_FAULT_PREFIX   only files at or below this absolute path are concerned
//   V3D_FAULT_REPORT   file outside the prefix, sizeof(FaultReport) long (fault_report.h)
//   V3D_FAULT_CALL     family of calls that fails (kFaultCalls)
//   V3D_FAULT_NUMBER   which call of it fails, from 1; 0: none, calls are counted only
//   V3D_FAULT_LASTS    1: every later call of it fails as well
//   V3D_FAULT_KIND     EIO, ENOSPC, EMFILE, EINTR, SHORT (half of the bytes), or POWER_CUT: before
//                      the call, of the ext4 file system of the prefix; the program ends with it
//   V3D_FAULT_PROGRAM  only in programs of this name; empty: in all
//   V3D_FAULT_TRACE    file outside the prefix: every change below the prefix is appended
//                      (fault_trace.h)
//   V3D_FAULT_MARKS    file outside the prefix: what is written to it enters the trace as marks
#pragma once

#include <string>

#include "fault_report.h"

namespace v3d::test {

enum class FaultKind { kNone, kError, kShort, kPowerCut };

class FaultPlan {
 public:
  /// Of this process. Thread-safe.
  static FaultPlan& of_process();

  bool is_below(const std::string& path) const;
  bool is_marks(const std::string& path) const { return !marks_.empty() && path == marks_; }
  /// Counts one call on this file and decides what becomes of it.
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

/// Absolute, without resolving links; relative to the folder `at`, or to the working folder
/// (AT_FDCWD).
std::string absolute_path(int at, const char* path);
/// The name under which the file was opened, or has now; empty when `fd` is none.
std::string path_of(int fd);

}  // namespace v3d::test
