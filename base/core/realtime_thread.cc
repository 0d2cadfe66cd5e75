#include "base/core/realtime_thread.h"

#include <pthread.h>
#include <sched.h>
#include <sys/resource.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <cstdint>

namespace v3d {
namespace {

/// Of 1 to 99; low, so that threads with a configured priority run first.
constexpr int kPriority = 10;
constexpr uint64_t kShortestSliceNs = 100'000;

/// The kernel's struct sched_attr, first version. glibc 2.36 has neither the struct nor the call.
struct SchedulingAttributes {
  uint32_t size = sizeof(SchedulingAttributes);
  uint32_t policy = SCHED_OTHER;
  uint64_t flags = 0;
  int32_t nice = 0;
  uint32_t priority = 0;
  uint64_t runtime_ns = kShortestSliceNs;  ///< for SCHED_OTHER: the time slice
  uint64_t deadline_ns = 0;
  uint64_t period_ns = 0;
};

}  // namespace

void make_thread_realtime() {
  sched_param parameters{};
  parameters.sched_priority = kPriority;
  if (pthread_setschedparam(pthread_self(), SCHED_FIFO, &parameters) == 0) return;
  SchedulingAttributes attributes;
  attributes.nice = getpriority(PRIO_PROCESS, 0);
  syscall(SYS_sched_setattr, 0, &attributes, 0);
}

}  // namespace v3d
