// For threads that do little, but at once.
#pragma once

namespace v3d {

/// The calling thread runs as soon as it wakes, whatever else the machine is busy with: in real
/// time where the process may (RLIMIT_RTPRIO), else with the shortest time slice, which Linux 6.12
/// and later put before longer ones and grant to anybody. On older kernels it waits for its turn.
void make_thread_realtime();

}  // namespace v3d
