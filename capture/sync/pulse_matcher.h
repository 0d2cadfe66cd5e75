// Labels frames with pulses.
#pragma once

#include <cstdint>
#include <optional>
#include <span>

#include "base/core/time.h"

namespace v3d::capture {

// Kalman filter that maps the times of one clock to pulse numbers.

/// Two states: the time of the latest pulse, and the period on this clock. The period starts at the
/// nominal value with the tolerance of two crystals (200 ppm) and may drift slowly with
/// temperature. So the precision does not depend on the length of the train. Instants are
/// nanoseconds of one clock, which the caller selects. Not thread-safe.
class PulseFit {
 public:
  /// `jitter`: standard deviation of one time stamp, in periods.
  PulseFit(Duration period, double jitter);

  /// Restarts at `pulse`, which was at `instant_ns`. Keeps only the estimate of the period.
  void begin(int64_t pulse, int64_t instant_ns);
  bool is_started() const { return started_; }

  /// The pulse number at this instant, with its fraction. Requires is_started().
  double pulse_at(int64_t instant_ns) const;
  /// Number of periods between two instants, with its fraction.
  double periods(int64_t from_ns, int64_t to_ns) const;
  /// Standard deviation of pulse_at() at the time of `pulse`, in periods.
  double stddev(int64_t pulse) const;

  /// Updates the filter: `pulse` was measured at `instant_ns`. Ignores pulses that are not later
  /// than the latest one.
  void update(int64_t pulse, int64_t instant_ns);

 private:
  double nominal_;         ///< ns
  double stamp_variance_;  ///< of one time stamp, ns^2
  double drift_variance_;  ///< change of the period per pulse, ns^2

  bool started_ = false;
  int64_t pulse_ = 0;    ///< latest pulse
  int64_t instant_ = 0;  ///< time of the latest pulse, ns, without fraction_
  double fraction_ = 0;  ///< fraction of a nanosecond, to be added to instant_
  double period_;        ///< ns
  // Covariance matrix of (instant, period), ns^2.
  double instant_variance_ = 0;
  double covariance_ = 0;
  double period_variance_;
};

// Assigns frames to pulses by the camera's clock, its frame counter and the time of arrival.

/// Times and counter of a received frame.
struct FrameStamp {
  DeviceInstant exposed;      ///< on the camera's clock
  uint64_t counter = 0;       ///< unwrapped frame number
  MonotonicInstant received;  ///< on this host's clock
};

struct PulseMatch {
  int64_t pulse = 0;
  bool suspect = false;
};

/// A frame with a certain pulse.
struct KnownFrame {
  FrameStamp stamp;
  int64_t pulse = 0;
};

/// The matcher uses no clock and no I/O. The pulse of the first frame must be known; pulse_times.h
/// finds it. Three independent sources give the pulse of each later frame:
///   - its device time, by a linear fit of times to pulses: exact while the clock keeps running;
///   - its counter: exact while every pulse makes one exposure;
///   - its arrival, by a second fit: never early, but delayed by host and network.
///
/// If the device time and the counter agree, the frame has that pulse. Otherwise the frame is
/// suspect: the camera missed a trigger or detected a false one, its clock stepped, or it
/// restarted. The frames after it are suspect as well until one of these is true:
///   - device time and counter agree as before;
///   - frames in a row advance equally by clock, counter and arrival. Then the arrival gives their
///     pulse. The second such frame is sufficient if the clock or the counter agrees with the
///     arrival. The ninth is required if both must have restarted, or the clock's fit is imprecise
///     after a long time without frames. It is also required if only the counter agrees, and the
///     clock gives a pulse that is up to ten earlier and has no frame: the frames may all be late.
///
/// A frame is suspect if
///   - the sources disagree as above; its label is the most likely pulse;
///   - it is not later than every frame before it: a duplicate, or a frame out of order;
///   - the camera was silent for so long that the fit is imprecise;
///   - the pulse of the first frame is uncertain: then all frames of the take are suspect.
///
/// A matcher that resumes from frames which another process labelled (resume_from) has neither the
/// frame counter nor the length of the interruption. If the camera's clock and the arrival agree on
/// the pulse of the next frame, the frame has that pulse. If the clock restarted, the arrival
/// decides as above, but only after expect(). If the clock seems to have kept running and
/// contradicts the arrival, all frames stay suspect, also when the clock's fit is no longer
/// precise: one of the two is wrong. Only a different expect() starts the comparison again.
///
/// A label that is not suspect is right if all of these are true:
///   - The device clock is within 200 ppm of the generator's and drifts by less than 0.1 ppm per
///     second.
///   - Time stamps jitter by at most 0.1 periods, and arrivals, delays aside, by at most 0.3.
///   - An exposure without a pulse is at least 0.35 periods away from every pulse.
///   - At most 250 pulses in a row have no frame.
///   - No two sources err by the same whole number of pulses at the same time. Examples: a clock
///     steps back by as many periods as triggers were missed; after a disagreement, nine frames in
///     a row are late by the same whole number of periods.
class PulseMatcher {
 public:
  explicit PulseMatcher(Duration period);

  /// Starts a take: the next frame is the first one and belongs to `first_pulse`. Unless `certain`,
  /// all labels may be shifted, and all frames are suspect.
  void begin(int64_t first_pulse, bool certain) {
    last_pulse_ = first_pulse;
    start_uncertain_ = !certain;
  }

  /// Labels the next frame.
  PulseMatch label(const FrameStamp& frame);

  /// The camera was opened again: its counter restarted, and its clock may have.
  void reopened() { reopened_ = is_started(); }

  /// Resumes a take after `frames`, instead of begin(). Requires at least one frame; their pulses
  /// must rise.
  void resume_from(std::span<const KnownFrame> frames);
  /// True from resume_from() until a frame is certain.
  bool is_resuming() const { return resumed_; }
  /// Sets the expected arrival of the frame of `pulse`, from the times of pulses and the latency.
  void expect(int64_t pulse, MonotonicInstant arrival);

 private:
  /// Consecutive suspect frames that advance equally by all sources.
  struct Run {
    FrameStamp last;
    int64_t pulse = 0;  ///< of `last`, by arrival
    int confirmations = 0;
  };
  /// The pulse of one frame according to each source.
  struct Evidence {
    double by_clock = 0;
    int64_t clock_pulse = 0;  ///< nearest to by_clock
    bool off_pulse = false;   ///< by_clock is near no pulse
    int64_t by_counter = 0;
    double by_arrival = 0;
  };

  bool is_started() const { return fit_.is_started(); }
  PulseMatch first(const FrameStamp& frame);
  Evidence evaluate(const FrameStamp& frame) const;
  bool is_consistent(const Evidence& e) const;
  PulseMatch accept(int64_t pulse, const FrameStamp& frame);
  PulseMatch handle_inconsistent(const Evidence& e, const FrameStamp& frame);
  bool clock_contradicts(const Evidence& e);
  void extend_run(const Evidence& e, const FrameStamp& frame);
  bool run_is_conclusive(const Evidence& e) const;
  int64_t most_likely_pulse(const Evidence& e) const;
  /// Restarts clock fit and counter at `frame`, which belongs to `pulse`.
  void resynchronise(int64_t pulse, const FrameStamp& frame);
  void learn_arrival(int64_t pulse, MonotonicInstant received);

  PulseFit fit_;                  ///< device clock to pulses
  PulseFit arrivals_;             ///< host clock to pulses, latency included
  int on_time_frames_ = 0;        ///< frames on time since arrivals_ started, at most 8
  double delay_ = 0;              ///< of the last frame, periods
  int steadily_late_ = 0;         ///< late frames in a row with the same delay
  bool start_uncertain_ = false;  ///< all labels may be shifted
  bool reopened_ = false;         ///< reopened and not yet resynchronised
  bool resumed_ = false;          ///< resumed from another process and not yet resynchronised
  bool is_expected_ = false;      ///< expect() was called
  bool contradicted_ = false;     ///< resumed, and the clock has contradicted the arrivals
  /// Standard deviation of the clock's fit at the first frame after resume_from(), periods.
  std::optional<double> resumed_stddev_;
  int stragglers_ = 0;       ///< late or duplicate frames in a row
  bool unreliable_ = false;  ///< clock and counter are not used until resynchronised
  std::optional<Run> run_;
  int64_t last_pulse_ = 0;     ///< latest pulse that is not suspect; at the start the first pulse
  uint64_t last_counter_ = 0;  ///< of the frame of last_pulse_
};

}  // namespace v3d::capture
