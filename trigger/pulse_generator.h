// What triggers the cameras, behind one small interface; gpio, scpi and simulated generators
// implement it.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "base/time.h"

namespace v3d {

struct PulseTrain {
  double rate_hz = 25;
  Duration width = std::chrono::milliseconds(1);
  std::optional<int64_t> count;  ///< empty: until stopped
};

/// One thread calls; implementations own any thread they need and join it in their destructor. The
/// output is inactive except between start() and the end of the train, on every way out.
class PulseGenerator {
 public:
  virtual ~PulseGenerator() = default;
  /// Sets the train up and reads it back; the output stays inactive. Throws InputError when the
  /// generator cannot make this train or cannot be reached.
  virtual void arm(const PulseTrain& train) = 0;
  /// The first pulse follows within a period. Requires arm().
  virtual void start() = 0;
  /// No pulse begins after this returns. Idempotent.
  virtual void stop() = 0;
  /// Pulses commanded since start(): the places of the train that have passed. A pulse that could
  /// not be made in time keeps its number, is told of in fault(), and is missing.
  virtual int64_t commanded() const = 0;
  /// True once a train of known length has ended, or after stop().
  virtual bool finished() const = 0;
  /// How late the latest pulse since start() was, skipped ones included.
  virtual Duration worst_lateness() const = 0;
  /// What went wrong while running, one line; empty when nothing did.
  virtual std::string fault() const = 0;
};

/// An edge that the sense line saw.
struct SensedPulse {
  int64_t number = 0;  ///< counted from 0 since the last reset()
  MonotonicInstant at;
};

/// The line that sees the pulses themselves.
class PulseSensor {
 public:
  virtual ~PulseSensor() = default;
  /// Forgets edges that nobody took and counts from 0 again. Throws InputError when the line cannot
  /// be reached.
  virtual void reset() = 0;
  /// The next edge, waiting until `deadline`; empty when none came. One thread.
  virtual std::optional<SensedPulse> wait(MonotonicInstant deadline) = 0;
  /// What went wrong, one line; empty when nothing did. A sensor with a fault senses nothing.
  virtual std::string fault() const = 0;
};

}  // namespace v3d
