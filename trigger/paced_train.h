// A pulse train that this host paces itself, by absolute deadlines of CLOCK_MONOTONIC.
#pragma once

#include <mutex>
#include <string>
#include <thread>

#include "trigger/host_clock.h"
#include "trigger/lateness.h"
#include "trigger/pulse_generator.h"

namespace v3d {

/// Where the pulses go. The thread of the train calls.
class PulseOutput {
 public:
  virtual ~PulseOutput() = default;
  /// The pulse that stands at `at` in the train begins now. False when the output is gone.
  virtual bool begin_pulse(MonotonicInstant at) = 0;
  virtual bool end_pulse() = 0;
};

/// Pulse k stands at start + k * period; the start is when this host was ready for pulse 0. A pulse
/// later than `skip_after` is not made: it keeps its number, is counted, and told of in fault().
class PacedTrain {
 public:
  struct Plan {
    Duration period{};
    Duration width{};  ///< 0: begin_pulse() is all that a pulse is
    std::optional<int64_t> count;
    Duration skip_after{};
  };

  /// `output` outlives the train.
  PacedTrain(PulseOutput& output, HostClock clock) : output_(output), clock_(std::move(clock)) {}
  ~PacedTrain();
  PacedTrain(const PacedTrain&) = delete;
  PacedTrain& operator=(const PacedTrain&) = delete;

  /// Ends a train that runs, to its last edge, and forgets its account.
  void plan(const Plan& plan);
  /// The first pulse follows within a period.
  void start();
  /// No pulse begins after this returns; one that has begun ends by itself.
  void stop();

  int64_t commanded() const;
  /// Empty before pulse 0.
  std::optional<MonotonicInstant> first_pulse() const;
  int64_t skipped() const;
  bool finished() const;
  /// The output was gone.
  bool broken() const;
  PulseStatistics statistics() const;
  /// "3 pulses skipped: this host was up to 95 ms late", or nothing.
  std::string fault() const;

 private:
  void run(MonotonicInstant first);
  /// False when stopped.
  bool wait_for(MonotonicInstant instant) const;
  /// Return false when the train is over.
  bool pulse(int64_t number, MonotonicInstant at);
  bool end_pulse(MonotonicInstant begun);
  void forget();
  void join();

  PulseOutput& output_;
  const HostClock clock_;
  Plan plan_;
  std::thread thread_;

  mutable std::mutex mutex_;  ///< everything below, and the beginning of a pulse
  bool stopped_ = true;
  bool broken_ = false;
  int64_t commanded_ = 0;
  std::optional<MonotonicInstant> first_;
  int64_t skipped_ = 0;
  Lateness lateness_;
};

}  // namespace v3d
