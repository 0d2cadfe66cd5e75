// Simulated host clock: time passes only during sleeps, and chosen sleeps take too long.
#pragma once

#include <algorithm>
#include <map>

#include "trigger/paced_train.h"

namespace v3d::trigger {

struct SlowHost {
  /// `delays`: additional sleep, by the time at which the sleep should end.
  explicit SlowHost(std::map<MonotonicInstant, Duration> delays = {})
      : oversleeps(std::move(delays)) {}

  HostClock clock() {
    return {.now = [this] { return now; },
            .sleep_until =
                [this](MonotonicInstant until) {
                  now = std::max(now, until);
                  const auto delay = oversleeps.find(now);
                  if (delay != oversleeps.end()) now += delay->second;
                }};
  }
  std::map<MonotonicInstant, Duration> oversleeps;
  MonotonicInstant now{std::chrono::seconds(100)};
};

}  // namespace v3d::trigger
