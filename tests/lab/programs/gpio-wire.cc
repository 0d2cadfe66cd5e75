// gpio-wire VALUE PULL: a wire from an output of gpio-sim to an input, both given by their files in
// sysfs. The kernel tells nobody of an output's change, so the wire looks every 200 us, before all
// else that runs, and passes a change on within that time. At SIGTERM it prints "PULSES GAP_US":
// pulses that passed, and the longest time that it did not look between the first pulse and the
// last; pulses and pauses longer than that cannot have escaped it.
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
  int64_t longest = 0;  // since the first pulse
  int64_t told = 0;     // the same until the last change
  for (int64_t looked = now_us(); stopping == 0;) {
    char level = '0';
    if (pread(value, &level, 1, 0) != 1) break;
    if ((level == '1') != active) {
      active = !active;
      pulses += active ? 1 : 0;
      told = longest;
      const char* word = active ? "pull-up" : "pull-down";
      if (pwrite(pull, word, std::strlen(word), 0) < 0) std::perror("gpio-wire");
    }
    const timespec pause{0, 200'000};
    nanosleep(&pause, nullptr);
    const int64_t now = now_us();
    longest = pulses == 0 ? 0 : std::max(longest, now - looked);
    looked = now;
  }
  std::printf("%ld %lld\n", pulses, static_cast<long long>(told));
  return 0;
}
