// Fault injection for the wall clock of a daemon, preloaded with LD_PRELOAD. While the file
// $V3D_SET_CLOCK exists, the CLOCK_REALTIME of the program $V3D_SET_CLOCK_OF is ahead of the right
// time by the number of seconds in the file; a negative number puts it behind.
#include <dlfcn.h>

#include <atomic>
#include <cerrno>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <string_view>

namespace {

using ClockGettime = int(clockid_t, timespec*);

ClockGettime* real() {
  static auto* const next = reinterpret_cast<ClockGettime*>(dlsym(RTLD_NEXT, "clock_gettime"));
  return next;
}

long read_seconds() {
  const char* const control = std::getenv("V3D_SET_CLOCK");
  std::FILE* const file = control != nullptr ? std::fopen(control, "re") : nullptr;
  if (file == nullptr) return 0;
  long seconds = 0;
  if (std::fscanf(file, "%ld", &seconds) != 1) seconds = 0;
  std::fclose(file);
  return seconds;
}

bool is_target_program() {
  static const bool is_target = [] {
    const char* const program = std::getenv("V3D_SET_CLOCK_OF");
    return program != nullptr && std::string_view(program) == program_invocation_short_name;
  }();
  return is_target;
}

/// The offset of the clock, seconds. Reads the file at most ten times a second.
long seconds_ahead() {
  static std::atomic<long> known = 0;
  static std::atomic<long long> read_at = -1;
  timespec now{};
  real()(CLOCK_MONOTONIC, &now);
  const long long tenth = now.tv_sec * 10LL + now.tv_nsec / 100'000'000;
  if (read_at.exchange(tenth) != tenth) known = read_seconds();
  return known;
}

}  // namespace

extern "C" int clock_gettime(clockid_t clock, timespec* time) noexcept {
  const int error = real()(clock, time);
  if (error == 0 && clock == CLOCK_REALTIME && is_target_program()) time->tv_sec += seconds_ahead();
  return error;
}
