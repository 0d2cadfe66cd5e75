// Memory that a program under fault injection shares with the test: counts of system calls, and
// where the fault was injected. The file $V3D_FAULT_REPORT, mapped by both, so that it survives a
// program that is killed.
#pragma once

#include <algorithm>
#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <string_view>

namespace v3d::test {

/// Families of system calls that a fault can hit; "open64" counts as "open", and so on.
inline constexpr std::array<std::string_view, 23> kFaultCalls = {"open",
                                                                 "opendir",
                                                                 "readdir",
                                                                 "stat",
                                                                 "read",
                                                                 "pread",
                                                                 "write",
                                                                 "writev",
                                                                 "pwrite",
                                                                 "pwritev",
                                                                 "fsync",
                                                                 "syncfs",
                                                                 "sync_file_range",
                                                                 "rename",
                                                                 "unlink",
                                                                 "rmdir",
                                                                 "truncate",
                                                                 "mkdir",
                                                                 "statvfs",
                                                                 "link",
                                                                 "fallocate",
                                                                 "copy",
                                                                 "mmap"};

/// Position in kFaultCalls; kFaultCalls.size() when there is no such family.
constexpr size_t fault_call(std::string_view name) {
  return static_cast<size_t>(std::find(kFaultCalls.begin(), kFaultCalls.end(), name) -
                             kFaultCalls.begin());
}

struct FaultReport {
  /// Calls on files below $V3D_FAULT_PREFIX, of all processes, by family.
  std::array<std::atomic<uint32_t>, kFaultCalls.size()> calls;
  std::atomic<uint32_t> fired;      ///< faults that were injected
  std::array<char, 1024> fired_on;  ///< path of the file; the last fault
  std::atomic<uint32_t> trace_lock;
};

}  // namespace v3d::test
