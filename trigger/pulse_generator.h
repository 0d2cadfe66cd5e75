// Pulse generator: interface, parameters, factory, numbers of sensed pulses.
#pragma once

#include <cmath>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "base/config/studio_file.h"
#include "base/core/time.h"

namespace v3d::trigger {

// Parameters of a pulse train: rate, width and count.

struct PulseTrain {
  double rate_hz = 25;
  Duration width = std::chrono::milliseconds(1);
  std::optional<int64_t> count;  ///< pulses; empty: until stopped
};

/// Throws InputError when no generator can make the train. The message starts with `source`, the
/// name of the generator.
void check_train(const PulseTrain& train, const std::string& source);

// Interfaces of the camera trigger: pulse generator and sense line. GPIO, SCPI, simulated and
// action triggers implement them.

/// Lateness of the starts of pulses, by this host's clock. A skipped pulse counts with its lateness
/// at the time of the decision. Percentiles are exact or up to 10 % too large.
struct PulseStatistics {
  Duration jitter_p50{};
  Duration jitter_p99{};
  Duration jitter_max{};
  int64_t late = 0;  ///< pulses late by more than a tenth of a period, including skipped ones
  // Of action commands: acknowledgements, summed over the cameras. Empty for other generators.
  std::optional<int64_t> acks_missing = {};   ///< none came before the deadline
  std::optional<int64_t> acks_rejected = {};  ///< with another status than success
};

class PulseSensor;

/// PulseGenerator::fault() begins with this where stop() could not end the pulses.
inline constexpr char kPulsesMayContinue[] = "pulses may continue";

/// A source of trigger pulses. The output is inactive except between start() and the end of the
/// train, also after errors.
///
/// Threads: one caller. Implementations own the threads that they need and join them in their
/// destructor.
class PulseGenerator {
 public:
  virtual ~PulseGenerator() = default;
  /// Makes the output inactive, also after a crash of another process that had used it. Throws
  /// InputError when the generator cannot be reached.
  virtual void silence() = 0;
  /// Programs the train and verifies the settings; the output stays inactive. Throws InputError
  /// when the generator cannot make this train or cannot be reached.
  virtual void arm(const PulseTrain& train) = 0;
  /// Whether the work of arm() is done. Throws InputError, once, when it failed.
  virtual bool armed() { return true; }
  /// For generators whose pulses need a common clock of this host and the cameras. `fault`: why
  /// they have none, one line; empty: they have one, as after arm(). Call it between armed() and
  /// start().
  virtual void set_clock_fault(const std::string& fault) { (void)fault; }
  /// The first pulse follows within a period. Requires armed().
  virtual void start() = 0;
  /// No pulse starts after this returns, unless fault() begins with kPulsesMayContinue.
  /// Idempotent.
  virtual void stop() = 0;
  /// After a stop() that failed: tries again, as when an instrument was plugged in again. Does not
  /// wait. Otherwise nothing. Call it once a second.
  virtual void retry_stop() {}
  /// Pulses commanded since start(): those whose time in the train has passed. A pulse that was
  /// skipped because it was late counts, too, and keeps its number; fault() reports it.
  virtual int64_t commanded() const = 0;
  /// Time of pulse 0 by this host's clock where is_paced_by_this_host(). Otherwise it may be that
  /// of the start, up to tens of milliseconds earlier; never later than pulse 0. Empty before pulse
  /// 0, and where the time is unknown.
  virtual std::optional<MonotonicInstant> first_pulse() const = 0;
  /// True once a train of known length has ended, or after stop().
  virtual bool finished() const = 0;
  /// False where commanded() is an estimate by this host's clock; then the count of the sense line
  /// is more accurate.
  virtual bool counts_exactly() const { return true; }
  /// True where pulse n is exactly n periods after first_pulse() on this host's clock.
  virtual bool is_paced_by_this_host() const { return false; }
  /// Statistics of the pulses since start(); zeros where another device makes the pulses.
  virtual PulseStatistics statistics() const = 0;
  /// The fault of the running train, or of the last one, one line; empty when there is none.
  virtual std::string fault() const = 0;
  /// A problem that does not disturb the train but needs the operator's attention, one line;
  /// empty when there is none.
  virtual std::string warning() const { return {}; }
  /// A sensor for generators that are informed of the pulses by the cameras; null for others, which
  /// need a sense line. It may outlive the generator.
  virtual std::unique_ptr<PulseSensor> own_sensor();
};

/// A pulse on the sense line.
struct SensedPulse {
  int64_t number = 0;                  ///< counted from 0 since the last reset()
  MonotonicInstant at;                 ///< its first edge
  std::optional<Duration> width = {};  ///< empty where it is unknown
  bool is_numbered = false;            ///< `number` is that of the commanded pulse
};

/// The sense line: reads the pulses back at the far end of the trigger cable.
///
/// Threads: one caller; another thread may call wait() while the first one calls fault().
class PulseSensor {
 public:
  virtual ~PulseSensor() = default;
  /// Discards unread edges and restarts the count at 0. Throws InputError when the line cannot be
  /// opened.
  virtual void reset() = 0;
  /// Waits for the next pulse until `deadline`; empty when none came. Not to be called during
  /// reset().
  virtual std::optional<SensedPulse> wait(MonotonicInstant deadline) = 0;
  /// The fault, one line; empty when there is none. A sensor with a fault does not sense pulses
  /// reliably.
  virtual std::string fault() const = 0;
};

// Factories of the generator and the sense line that a studio file describes.

/// Do not access the hardware; arm() and reset() do.
std::unique_ptr<PulseGenerator> make_generator(const StudioTrigger& trigger);
/// `generator`: of the same trigger. Null where the pulses are not sensed.
std::unique_ptr<PulseSensor> make_sensor(const StudioTrigger& trigger, PulseGenerator& generator);

// Assigns pulse numbers to sensed pulses, by comparison with the commanded train.

/// Numbers sensed pulses by the time since the previous pulse, in periods.
///
/// A line carries no pulse numbers, and pulses may be missing. The first sensed pulse is pulse 0,
/// as the first frame is frame 0: give it pulses from the start of the train on only. A pulse less
/// than half a period after the previous one is extra and changes no number. A pulse of less than
/// half the commanded width is a runt. A runt within an eighth of a period of its expected time
/// gets a number, because cameras may have been triggered by it; another runt is extra. A pulse
/// that is_numbered keeps its number. Not thread-safe.
class SensedTrain {
 public:
  explicit SensedTrain(const PulseTrain& train)
      : period_(to_seconds(period_of(train.rate_hz))), min_width_(train.width / 2) {}

  /// The number of the pulse, larger than all previous numbers; empty for an extra pulse.
  std::optional<int64_t> number(const SensedPulse& pulse) {
    if (pulse.is_numbered) return adopt(pulse);
    const bool runt = pulse.width && *pulse.width < min_width_;
    const double periods = last_ ? to_seconds(pulse.at - *last_) / period_ : 0;
    const auto whole = static_cast<int64_t>(std::llround(periods));
    const bool out_of_place = std::abs(periods - static_cast<double>(whole)) > kRuntTolerance;
    if (last_ && (whole < 1 || (runt && out_of_place))) {
      ++extra_;
      return std::nullopt;
    }
    number_ += whole;
    last_ = pulse.at;
    ++sensed_;
    if (runt) runts_.push_back(number_);
    return number_;
  }

  /// Counts a pulse that was sensed before the start of the train.
  void count_extra() { ++extra_; }

  /// The number of pulses with a number.
  int64_t sensed() const { return sensed_; }
  /// The number of extra pulses.
  int64_t extra() const { return extra_; }
  /// Numbers of the runts in the train.
  const std::vector<int64_t>& runts() const { return runts_; }

 private:
  std::optional<int64_t> adopt(const SensedPulse& pulse) {
    if (last_ && pulse.number <= number_) {
      ++extra_;
      return std::nullopt;
    }
    number_ = pulse.number;
    last_ = pulse.at;
    ++sensed_;
    return number_;
  }

  static constexpr double kRuntTolerance = 0.125;  ///< of a period

  const double period_;
  const Duration min_width_;
  std::optional<MonotonicInstant> last_;
  int64_t number_ = 0;
  int64_t sensed_ = 0;
  int64_t extra_ = 0;
  std::vector<int64_t> runts_;
};

}  // namespace v3d::trigger
