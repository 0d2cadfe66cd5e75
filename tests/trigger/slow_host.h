// A host whose time passes only while it sleeps, and that oversleeps as it is told.
#pragma once

#include <algorithm>
#include <map>

#include "trigger/host_clock.h"

namespace v3d {

struct SlowHost {
  /// When it wakes, and by how much too late.
  explicit SlowHost(std::map<MonotonicInstant, Duration> holds = {}) : held_up(std::move(holds)) {}

  HostClock clock() {
    return {.now = [this] { return now; },
            .sleep_until =
                [this](MonotonicInstant until) {
                  now = std::max(now, until);
                  const auto hold = held_up.find(now);
                  if (hold != held_up.end()) now += hold->second;
                }};
  }
  std::map<MonotonicInstant, Duration> held_up;
  MonotonicInstant now{std::chrono::seconds(100)};
};

}  // namespace v3d
