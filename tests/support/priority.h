// Priorities of the processes of a story, as in a studio: cameras and cables are hardware, which
// does not wait for a busy PC, and systemd gives the capture daemon a higher priority.
#pragma once

#include <sys/resource.h>

#include <algorithm>
#include <string>
#include <vector>

namespace v3d::test {

/// Of simulated hardware, v3d-sim and test programs, which connect its cables: that of
/// v3d-captured. A higher one would delay v3d-captured while v3d-sim draws its pictures.
inline constexpr int kHardwareNice = -10;

/// The nice value of a command with its arguments. Those of daemons are in systemd/*.service.
inline int nice_of(const std::vector<std::string>& command) {
  const auto runs = [&](const std::string& program) {
    return std::ranges::any_of(
        command, [&](const std::string& part) { return part.ends_with("/" + program); });
  };
  if (runs("v3d-sim") || runs("v3d-captured")) return kHardwareNice;
  return runs("v3d-viewd") ? 5 : 0;
}

/// Gives this process the priority of hardware, and permits it and its children these nice values
/// and real-time threads (LimitRTPRIO=50). Has no effect without the rights of root. Call it before
/// this process enters a user namespace.
inline void use_hardware_priority() {
  const rlimit nice_limit{20 - kHardwareNice, 20 - kHardwareNice};
  const rlimit real_time_limit{50, 50};
  setrlimit(RLIMIT_NICE, &nice_limit);
  setrlimit(RLIMIT_RTPRIO, &real_time_limit);
  setpriority(PRIO_PROCESS, 0, kHardwareNice);
}

}  // namespace v3d::test
