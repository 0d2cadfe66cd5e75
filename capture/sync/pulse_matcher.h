// Which pulse exposed a frame. By the camera's clock, cross-checked with the camera's frame
// counter; where the two disagree, the time of arrival decides which of them to believe.
#pragma once

#include <cstdint>
#include <optional>
#include <span>

#include "base/core/time.h"
#include "capture/sync/pulse_fit.h"

namespace v3d {

/// What is known of an exposure when its frame is here.
struct FrameStamp {
  DeviceInstant exposed;
  uint64_t counter = 0;  ///< unwrapped
  MonotonicInstant received;
};

struct PulseMatch {
  int64_t pulse = 0;
  bool suspect = false;
};

/// A frame whose pulse is known without doubt.
struct KnownFrame {
  FrameStamp stamp;
  int64_t pulse = 0;
};

/// Pure: no clock, no I/O. Which pulse the first frame is has to be known (train_start.h finds it).
/// Then there are three witnesses of a frame's pulse:
///   - its device time, which a running linear fit maps to pulses: exact while the clock runs on;
///   - its counter: exact while every pulse is one exposure;
///   - its arrival, mapped by a fit of its own: never early, but late by whatever the host and the
///     network hesitate.
/// A frame on whose pulse the first two agree has that pulse. Anything else (the camera missed a
/// trigger or saw one that was none, its clock was stepped, it began anew) is in doubt, and so are
/// the frames that follow: until the old agreement is back, or until frames in a row have advanced
/// alike by clock, counter and arrival. Their arrival then tells their pulse: with the second frame
/// where the clock or the counter agrees with it, with the ninth where both must have begun anew.
///
/// A frame is suspect when
///   - it is in doubt; its label is the likeliest one;
///   - it is not later than every frame before it (a duplicate, a straggler);
///   - the camera was silent for so long that the fit says little;
///   - it is not certain which pulse the first frame is: then all frames of the take are.
///
/// A matcher that goes on from frames that another process had labelled (go_on_from) does not know
/// the counter, and how long it was away. Where the camera's clock and the arrival agree on the
/// next frame's pulse, it has that pulse. A clock that began anew is outvoted by the arrival as
/// above, but one that seems to have gone on and says otherwise is not: then all stays in doubt.
///
/// A label that is not suspect is right as long as: the device clock runs within 200 ppm of the
/// generator's and wanders by less than 0.1 ppm a second; time stamps jitter by at most a tenth of
/// a period, arrivals (delays apart) by at most three tenths; an exposure that no pulse made is at
/// least 0.35 periods away from all of them; at most 250 pulses in a row are
/// without a frame; and no two of the witnesses err by the same whole number of pulses at the same
/// time (a clock stepped back by as many periods as triggers were missed; after a disagreement,
/// two frames in a row that are both late by the same whole number of periods).
class PulseMatcher {
 public:
  explicit PulseMatcher(Duration period);

  /// The next frame is the first, and of this pulse; unless `certain`, all may be shifted.
  void begin(int64_t first_pulse, bool certain) {
    last_pulse_ = first_pulse;
    start_unknown_ = !certain;
  }

  /// Labels the next frame.
  PulseMatch label(const FrameStamp& frame);

  /// The camera was opened again: its counter began anew, and its clock may have.
  void reopened() { reopened_ = begun(); }

  /// The take goes on, after these of its frames: rising pulses, at least one. Instead of begin().
  void go_on_from(std::span<const KnownFrame> frames);
  /// By what is known of the pulses, a frame of this one would arrive then.
  void expect(int64_t pulse, MonotonicInstant arrival);

 private:
  /// A row of frames that advanced alike by all witnesses, in doubt.
  struct Row {
    FrameStamp last;
    int64_t pulse = 0;  ///< of `last`, by arrival
    int confirmations = 0;
  };
  /// What the witnesses say of one frame.
  struct Evidence {
    double by_clock = 0;
    int64_t clock_pulse = 0;  ///< nearest to by_clock
    bool between = false;     ///< by_clock is near no pulse
    int64_t by_counter = 0;
    double by_arrival = 0;
  };

  bool begun() const { return fit_.begun(); }
  PulseMatch first(const FrameStamp& frame);
  Evidence weigh(const FrameStamp& frame) const;
  bool agreed(const Evidence& e) const;
  PulseMatch accept(int64_t pulse, const FrameStamp& frame);
  PulseMatch doubt(const Evidence& e, const FrameStamp& frame);
  bool clock_objects(const Evidence& e) const;
  void lengthen_row(const Evidence& e, const FrameStamp& frame);
  bool row_convinces(const Evidence& e) const;
  int64_t likeliest(const Evidence& e) const;
  /// From here on counted anew: `frame` is `pulse`.
  void settle(int64_t pulse, const FrameStamp& frame);
  void learn_arrival(int64_t pulse, MonotonicInstant received);

  PulseFit fit_;                ///< device clock to pulses
  PulseFit arrivals_;           ///< host clock to pulses, latency included
  int punctual_ = 0;            ///< frames that arrived as arrivals_ says since it began
  double lateness_ = 0;         ///< of the last frame, periods
  int steadily_late_ = 0;       ///< frames in a row
  bool start_unknown_ = false;  ///< all pulses may be shifted
  bool reopened_ = false;       ///< and not yet settled
  bool was_away_ = false;       ///< goes on from what another process labelled; not yet settled
  int stragglers_ = 0;          ///< in a row
  bool astray_ = false;         ///< neither clock nor counter is believed until settled
  std::optional<Row> row_;
  int64_t last_pulse_ = 0;     ///< the latest that was labelled without doubt; before: the first
  uint64_t last_counter_ = 0;  ///< of the frame with last_pulse_
};

}  // namespace v3d
