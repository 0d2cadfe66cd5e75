// Real-time scheduling and locked memory, for threads that do little work but must start it on
// time.
#pragma once

namespace v3d {

/// Raises the scheduling priority of the calling thread, so that it runs as soon as it wakes.
/// Uses real-time scheduling (SCHED_FIFO) where the process may (RLIMIT_RTPRIO). Otherwise it
/// requests the shortest time slice: Linux 6.12 and later schedule it before longer ones and need
/// no permission. On older kernels the request has no effect.
void make_thread_realtime();

}  // namespace v3d
