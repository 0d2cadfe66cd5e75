// Train paced by this host, and its lateness.
#pragma once

#include <array>
#include <cstdint>
#include <mutex>
#include <string>
#include <thread>

#include "base/core/time.h"
#include "trigger/pulse_generator.h"

namespace v3d::trigger {

// Lateness statistics of a pulse train: a histogram of constant size. The percentiles of
// base/core/statistics.h need all values; a train of days at 1000 Hz has too many, and the thread
// that adds them must not allocate.

/// Not thread-safe.
class Lateness {
 public:
  /// A pulse that is later than `threshold` is counted as late.
  explicit Lateness(Duration threshold = {}) : threshold_(threshold) {}
  /// A negative value counts as 0.
  void add(Duration lateness);
  PulseStatistics statistics() const;
  Duration max() const { return max_; }

 private:
  /// The smallest value that at least the fraction `share` of all values do not exceed. It is
  /// rounded up to the end of its bucket.
  Duration percentile(double share) const;

  static constexpr int kPerOctave = 8;  ///< buckets per doubling
  Duration threshold_;
  Duration max_{};
  int64_t count_ = 0;
  int64_t late_count_ = 0;
  std::array<int64_t, 63 * kPerOctave> buckets_{};  ///< nanoseconds, logarithmic scale
};

// Pulse train that this host paces with absolute deadlines on CLOCK_MONOTONIC.

/// Receives the pulses. Called by the thread of the train.
class PulseOutput {
 public:
  virtual ~PulseOutput() = default;
  /// Starts the pulse `number`, which is due at `at`. Both return false where the output does not
  /// work any more.
  virtual bool begin_pulse(int64_t number, MonotonicInstant at) = 0;
  virtual bool end_pulse() = 0;
};

/// Pulse k is due at start + k * period. The start is the time at which this host was ready for
/// pulse 0. A pulse that is later than `skip_after` is skipped: it keeps its number, is counted,
/// and fault() reports it.
class PacedTrain {
 public:
  struct Plan {
    Duration period{};
    Duration width{};              ///< 0: end_pulse() is not called
    std::optional<int64_t> count;  ///< pulses; empty: until stop()
    Duration skip_after{};
  };

  /// `output` must outlive the train.
  PacedTrain(PulseOutput& output, HostClock clock) : output_(output), clock_(std::move(clock)) {}
  ~PacedTrain();
  PacedTrain(const PacedTrain&) = delete;
  PacedTrain& operator=(const PacedTrain&) = delete;

  /// Ends a running train, waits for its last edge, and resets the counters.
  void plan(const Plan& plan);
  /// The first pulse follows within a period.
  void start();
  /// No pulse starts after this returns. The thread ends a pulse that has started.
  void stop();

  int64_t commanded() const;
  /// Time at which pulse 0 was due; empty before pulse 0.
  std::optional<MonotonicInstant> first_pulse() const;
  int64_t skipped() const;
  bool finished() const;
  /// Whether the output reported an error, which ended the train.
  bool output_failed() const;
  PulseStatistics statistics() const;
  /// "3 pulses skipped: this host was up to 95 ms late", or an empty text.
  std::string fault() const;

 private:
  void run(MonotonicInstant first);
  /// Returns false when the train was stopped.
  bool wait_for(MonotonicInstant instant) const;
  /// Return false when the train is over.
  bool pulse(int64_t number, MonotonicInstant at);
  bool end_pulse(MonotonicInstant began);
  void reset_counters();
  void join();

  PulseOutput& output_;
  const HostClock clock_;
  Plan plan_;
  std::thread thread_;

  mutable std::mutex mutex_;  ///< guards the next members and the start of a pulse
  bool stopped_ = true;
  bool output_failed_ = false;
  int64_t commanded_ = 0;
  std::optional<MonotonicInstant> first_;
  int64_t skipped_ = 0;
  Lateness lateness_;
};

}  // namespace v3d::trigger
