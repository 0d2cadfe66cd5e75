// gpio-wire VALUE PULL: connects an output of gpio-sim to an input, both given by their files in
// sysfs.
//
// The kernel does not report changes of an output, so the program samples it every 200 us with
// real-time priority and copies each change. At SIGTERM it prints "PULSES GAP_US": the number of
// pulses, and the longest time between two samples from the first pulse to the last. Pulses and
// pauses longer than GAP_US cannot have been missed.
#include <fcntl.h>
#include <sched.h>
#include <unistd.h>

#include <algorithm>
#include <csignal>
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <ctime>

namespace {

volatile std::sig_atomic_t stopping = 0;

int64_t now_us() {
  timespec t{};
  clock_gettime(CLOCK_MONOTONIC, &t);
  return t.tv_sec * int64_t{1'000'000} + t.tv_nsec / 1000;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 3) return 2;
  const int value = open(argv[1], O_RDONLY);
  const int pull = open(argv[2], O_WRONLY);
  if (value < 0 || pull < 0) {
    std::perror("gpio-wire");
    return 1;
  }
  std::signal(SIGTERM, [](int) { stopping = 1; });
  sched_param priority{};
  priority.sched_priority = 50;
  if (sched_setscheduler(0, SCHED_FIFO, &priority) != 0) std::perror("gpio-wire: SCHED_FIFO");
  bool active = false;
  long pulses = 0;
  int64_t longest_gap = 0;   // between two samples since the first pulse
  int64_t reported_gap = 0;  // the same, until the last change
  for (int64_t last_sample = now_us(); stopping == 0;) {
    char level = '0';
    if (pread(value, &level, 1, 0) != 1) break;
    if ((level == '1') != active) {
      active = !active;
      pulses += active ? 1 : 0;
      reported_gap = longest_gap;
      const char* direction = active ? "pull-up" : "pull-down";
      if (pwrite(pull, direction, std::strlen(direction), 0) < 0) std::perror("gpio-wire");
    }
    const timespec pause{0, 200'000};
    nanosleep(&pause, nullptr);
    const int64_t now = now_us();
    longest_gap = pulses == 0 ? 0 : std::max(longest_gap, now - last_sample);
    last_sample = now;
  }
  std::printf("%ld %lld\n", pulses, static_cast<long long>(reported_gap));
  return 0;
}
