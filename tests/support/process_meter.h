// Periodic samples of the resources of a process.
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
  double seconds = 0;       ///< since the start of the meter
  double resident_kb = 0;   ///< exact: of smaps_rollup, not the kernel's lazy counter in status
  double processor_s = 0;   ///< processor time of all threads since the start of the process
  int64_t descriptors = 0;  ///< number of open descriptors
  int64_t threads = 0;
};

/// A sample without `seconds`; zeros when the process has ended.
ProcessSample sample(pid_t process);

/// Takes a sample twice a second, in a thread of its own. Thread-safe.
class ProcessMeter {
 public:
  explicit ProcessMeter(pid_t process);
  ~ProcessMeter();
  ProcessMeter(const ProcessMeter&) = delete;
  ProcessMeter& operator=(const ProcessMeter&) = delete;

  /// Seconds since the start of the meter.
  double now() const;
  /// Samples taken at `from` seconds or later.
  std::vector<ProcessSample> since(double from) const;

 private:
  const pid_t process_;
  const MonotonicInstant start_;
  mutable std::mutex mutex_;
  std::vector<ProcessSample> samples_;
  std::atomic<bool> stopping_ = false;
  std::thread thread_;
};

/// Growth of the resident memory, kB/h, by the Theil-Sen estimator: the median of the slopes of all
/// pairs, robust against almost a third of outliers. 0 for fewer than two samples.
double resident_kb_per_hour(const std::vector<ProcessSample>& samples);

}  // namespace v3d::test
