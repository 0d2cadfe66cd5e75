// The memory of this machine and of this process.
#pragma once

#include <cstdint>

namespace v3d {

/// Memory that can be had without swapping (MemAvailable of /proc/meminfo), bytes.
int64_t available_memory();

/// What this process has used of its memory, now or later, stays in memory where the process may
/// (no RLIMIT_MEMLOCK), so that no page of a thread that must be punctual is fetched from a disk.
void lock_memory();

}  // namespace v3d
