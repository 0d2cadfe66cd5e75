// Shared memory between a program under fault injection and the test: counts of system calls, and
// the file of the injected fault. Both map the file $V3D_FAULT_REPORT, so its content survives when
// the program is killed.
#pragma once

#include <algorithm>
#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <string_view>

namespace v3d::test {

/// Families of system calls that can fail; "open64" counts as "open", and so on.
inline constexpr std::array<std::string_view, 25> kFaultCalls = {"open",
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
                                                                 "mmap",
                                                                 "flock",
                                                                 "lseek"};

/// The mark that the injector writes before it cuts the power. Other threads of the program still
/// run until it is killed, and a sync that the cut interrupts can return success: with Linux 6.18,
/// in 3 of 676 cuts beside four busy processes. No program reports anything after a power cut, so
/// marks behind this one do not count.
inline constexpr std::string_view kPowerCutMark = "power cut";

/// Index of the family in kFaultCalls; kFaultCalls.size() when there is none.
constexpr size_t fault_call(std::string_view name) {
  return static_cast<size_t>(std::find(kFaultCalls.begin(), kFaultCalls.end(), name) -
                             kFaultCalls.begin());
}

/// The content of the shared memory.
struct FaultReport {
  /// Number of calls of all processes on files below $V3D_FAULT_PREFIX, by family.
  std::array<std::atomic<uint32_t>, kFaultCalls.size()> calls;
  std::atomic<uint32_t> fired;      ///< number of injected faults
  std::array<char, 1024> fired_on;  ///< path of the file of the last fault
  std::atomic<uint32_t> trace_lock;
};

}  // namespace v3d::test
