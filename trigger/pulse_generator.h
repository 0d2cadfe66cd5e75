// What triggers the cameras, behind one small interface; gpio, scpi and simulated generators
// implement it.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "base/core/time.h"
#include "trigger/pulse_train.h"

namespace v3d {

/// How far after its place in the train a pulse began, by this host's clock; skipped pulses count
/// with the lateness at which they were given up. Percentiles are within 10 % and never below.
struct PulseStatistics {
  Duration jitter_p50{};
  Duration jitter_p99{};
  Duration jitter_max{};
  int64_t late = 0;  ///< pulses by more than a tenth of a period, skipped ones included
};

/// One thread calls; implementations own any thread they need and join it in their destructor. The
/// output is inactive except between start() and the end of the train, on every way out.
class PulseGenerator {
 public:
  virtual ~PulseGenerator() = default;
  /// The output is inactive when this returns, whatever a process that died left it at. Throws
  /// InputError when the generator cannot be reached.
  virtual void silence() = 0;
  /// Sets the train up and reads it back; the output stays inactive. Throws InputError when the
  /// generator cannot make this train or cannot be reached.
  virtual void arm(const PulseTrain& train) = 0;
  /// False while what arm() began is not done yet. Throws InputError, once, when it failed.
  virtual bool armed() { return true; }
  /// The first pulse follows within a period. Requires armed().
  virtual void start() = 0;
  /// No pulse begins after this returns, or fault() says that they may go on. Idempotent.
  virtual void stop() = 0;
  /// Pulses commanded since start(): the places of the train that have passed. A pulse that could
  /// not be made in time keeps its number, is told of in fault(), and is missing.
  virtual int64_t commanded() const = 0;
  /// Where pulse 0 stood, by this host's clock; empty before, and where that is not known.
  virtual std::optional<MonotonicInstant> first_pulse() const = 0;
  /// True once a train of known length has ended, or after stop().
  virtual bool finished() const = 0;
  /// False where commanded() is an estimate by this host's clock: what the
  /// sense line saw is the better account.
  virtual bool counts_exactly() const { return true; }
  /// Of the pulses since start(); zeros where another machine makes the pulses.
  virtual PulseStatistics statistics() const = 0;
  /// What went wrong while running, one line; empty when nothing did.
  virtual std::string fault() const = 0;
};

/// A pulse that the sense line saw.
struct SensedPulse {
  int64_t number = 0;                  ///< counted from 0 since the last reset()
  MonotonicInstant at;                 ///< its first edge
  std::optional<Duration> width = {};  ///< empty where the line does not tell
};

/// The line that sees the pulses themselves. One thread calls, but for wait(): that may be another,
/// while the first asks for faults.
class PulseSensor {
 public:
  virtual ~PulseSensor() = default;
  /// Forgets edges that nobody took and counts from 0 again. Throws InputError when the line cannot
  /// be reached.
  virtual void reset() = 0;
  /// The next pulse, waiting until `deadline`; empty when none came. Not during reset().
  virtual std::optional<SensedPulse> wait(MonotonicInstant deadline) = 0;
  /// What went wrong, one line; empty when nothing did. A sensor with a fault senses nothing.
  virtual std::string fault() const = 0;
};

}  // namespace v3d
