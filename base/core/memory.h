// The memory of this machine and of this process.
#pragma once

#include <cstdint>

namespace v3d {

/// Memory that is available without swapping (MemAvailable of /proc/meminfo), bytes. INT64_MAX when
/// it is unknown.
int64_t available_memory();

/// Locks the memory of this process, current and future, where RLIMIT_MEMLOCK is unlimited. A
/// real-time thread then never waits for a page from a disk.
void lock_memory();

}  // namespace v3d
