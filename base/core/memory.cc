#include "base/core/memory.h"

#include <sys/mman.h>
#include <sys/resource.h>

#include <fstream>
#include <limits>
#include <string>

namespace v3d {

int64_t available_memory() {
  std::ifstream in("/proc/meminfo");
  std::string key;
  int64_t kibibytes = 0;
  for (std::string unit; in >> key >> kibibytes; std::getline(in, unit)) {
    if (key == "MemAvailable:") {
      return kibibytes * 1024;
    }
  }
  return std::numeric_limits<int64_t>::max();
}

void lock_memory() {
  rlimit limit{};
  // With a limit, later allocations would fail.
  if (getrlimit(RLIMIT_MEMLOCK, &limit) != 0 || limit.rlim_cur != RLIM_INFINITY) return;
  mlockall(MCL_CURRENT | MCL_FUTURE | MCL_ONFAULT);
}

}  // namespace v3d
