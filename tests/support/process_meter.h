// What a program takes of the machine, over time.
#pragma once

#include <sys/types.h>

#include <atomic>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "base/core/time.h"

namespace v3d::test {

struct ProcessSample {
  double seconds = 0;       ///< since the meter began
  double resident_kb = 0;   ///< exactly: smaps_rollup, not the kernel's lazy counter in status
  double processor_s = 0;   ///< of all its threads since it was started
  int64_t descriptors = 0;  ///< open
  int64_t threads = 0;
};

/// A sample; zeros when the process is gone.
ProcessSample sample(pid_t process);

/// Looks twice a second, in a thread of its own.
class ProcessMeter {
 public:
  explicit ProcessMeter(pid_t process);
  ~ProcessMeter();
  ProcessMeter(const ProcessMeter&) = delete;
  ProcessMeter& operator=(const ProcessMeter&) = delete;

  /// Seconds since it began.
  double now() const;
  /// Taken at `from` or later.
  std::vector<ProcessSample> since(double from) const;

 private:
  const pid_t process_;
  const MonotonicInstant began_;
  mutable std::mutex mutex_;
  std::vector<ProcessSample> samples_;
  std::atomic<bool> stopping_ = false;
  std::thread thread_;
};

/// Kilobytes an hour, by Theil and Sen: the median of the slopes of all pairs, which a third of
/// wild samples does not move. 0 for fewer than two samples.
double resident_kb_per_hour(const std::vector<ProcessSample>& samples);

}  // namespace v3d::test
