// Lateness of timer wake-ups, measured as cyclictest does.
#include <fmt/core.h>
#include <sched.h>

#include <algorithm>
#include <thread>

#include "base/core/statistics.h"
#include "base/io/process.h"
#include "v3dctl/setup/doctor.h"

namespace v3d::ctl {
namespace {

using Verdict = Finding::Verdict;

constexpr int kCycles = 10'000;
constexpr Duration kPeriod = std::chrono::milliseconds(1);

double microseconds(Duration d) { return std::chrono::duration<double, std::micro>(d).count(); }

}  // namespace

std::vector<Duration> measure_wakeups(const HostClock& clock, int cycles, Duration period) {
  std::vector<Duration> lateness;
  lateness.reserve(static_cast<size_t>(cycles));
  MonotonicInstant due = clock.now();
  for (int i = 0; i < cycles; ++i) {
    due += period;
    clock.sleep_until(due);
    const MonotonicInstant now = clock.now();
    lateness.push_back(now - due);
    // After a long delay, the wake-ups that it has covered are not repeated at once.
    if (now - due > period) due = now;
  }
  return lateness;
}

Finding judge_wakeups(const std::vector<Duration>& lateness, bool is_realtime, Duration limit) {
  const double p50 = microseconds(percentile(lateness, 0.5));
  const double p99 = microseconds(percentile(lateness, 0.99));
  const double p999 = microseconds(percentile(lateness, 0.999));
  const double max = microseconds(percentile(lateness, 1));
  Finding finding{Verdict::kGood,
                  "wake-ups",
                  fmt::format("{} timers, late by {:.0f} us (median), {:.0f} us (99 %), {:.0f} us "
                              "(99.9 %), at most {:.0f} us; the limit is {:.0f} us",
                              lateness.size(), p50, p99, p999, max, microseconds(limit)),
                  "",
                  {{"cycles", static_cast<double>(lateness.size())},
                   {"lateness_p50_us", p50},
                   {"lateness_p99_us", p99},
                   {"lateness_p999_us", p999},
                   {"lateness_max_us", max},
                   {"limit_us", microseconds(limit)},
                   {"realtime_flag", is_realtime ? 1.0 : 0.0}}};
  if (max <= microseconds(limit)) return finding;
  if (is_realtime) {
    finding.verdict = Verdict::kBad;
    finding.remedy =
        "isolate a processor for the trigger (docs/appliance.md, real time), or lower the rate";
  } else {
    finding.verdict = Verdict::kUnknown;
    finding.remedy = "run v3dctl doctor as root: this user has no real-time priority";
  }
  return finding;
}

Finding check_wakeups(const Studio& studio, bool is_trigger_here) {
  std::vector<Duration> lateness;
  bool is_realtime = false;
  std::thread([&] {
    make_thread_realtime();
    is_realtime = sched_getscheduler(0) == SCHED_FIFO;
    lateness = measure_wakeups({}, kCycles, kPeriod);
  }).join();
  Finding finding = judge_wakeups(lateness, is_realtime,
                                  max_pulse_lateness(from_seconds(1 / studio.trigger.rate_hz)));
  if (!is_trigger_here && finding.verdict == Verdict::kBad) {
    finding.verdict = Verdict::kUnknown;
    finding.remedy = "it matters on the PC with the trigger: v3dctl doctor " + studio.trigger.node;
  }
  return finding;
}

}  // namespace v3d::ctl
