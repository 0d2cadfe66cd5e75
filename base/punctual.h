// For threads that do little, but at once.
#pragma once

namespace v3d {

/// The calling thread runs as soon as it wakes, whatever else the machine is busy with: in real
/// time where the process may (RLIMIT_RTPRIO), else with the shortest time slice, which Linux 6.12
/// and later put before longer ones and grant to anybody. On older kernels it waits for its turn.
void become_punctual();

/// What this process has used of its memory, now or later, stays in memory where the process may
/// (no RLIMIT_MEMLOCK), so that no page of a thread that must be punctual is fetched from a disk.
void keep_memory();

}  // namespace v3d
