// Which pulse exposed a frame. Never by arrival time: by the camera's clock, cross-checked with the
// camera's frame counter.
#pragma once

#include <cstdint>
#include <optional>

#include "base/time.h"
#include "capture/pulse_fit.h"

namespace v3d {

struct PulseMatch {
  int64_t pulse = 0;
  bool suspect = false;
};

/// Pure: no clock, no I/O. The first frame after the quiet is pulse 0 (unless expect() tells that
/// exposures before it were lost). A later frame is the pulse nearest to its device time, which a
/// running linear fit maps to pulses. It is suspect when
///   - it lies more than a quarter of a period from that pulse; the counter then decides which of
///     the two neighbours it is,
///   - the counter moved by another number than the pulses did (the camera missed a trigger, or saw
///     one that was none),
///   - it is not later than every frame before it (a duplicate, a straggler),
///   - the camera was silent for so long that the fit says little,
///   - it is the first and its counter is not the expected one: exposures were lost, most likely
///     the first of this take (so it is labelled), possibly the last before the quiet.
///
/// A label that is not suspect is right as long as: the device clock runs within 200 ppm of the
/// generator's and wanders by less than 0.1 ppm a second; time stamps jitter by at most a tenth of
/// a period; at most 250 pulses in a row are without a frame. Beyond, labels are still right or
/// suspect unless the counter errs by the same number of pulses at the same time.
///
/// What cannot be known here: that the camera missed the very first trigger, or that the first
/// frame was lost when the counter before it is not known. The sense line and the ledger tell.
class PulseMatcher {
 public:
  explicit PulseMatcher(Duration period);

  /// The counter that the exposure of pulse 0 will have: one more than that of the last exposure
  /// before the quiet. With it, a first frame lost in transport does not shift the take unnoticed.
  void expect(uint64_t counter_of_pulse_0) { counter_of_pulse_0_ = counter_of_pulse_0; }

  /// Labels the next frame.
  PulseMatch label(DeviceInstant at, uint64_t counter);

  /// The camera began anew (its clock and its counter may have): the frame with this time and
  /// counter is `pulse`, and what follows is counted from there.
  void restart(int64_t pulse, DeviceInstant at, uint64_t counter);

  bool begun() const { return fit_.begun(); }
  /// The pulse at this time of the device clock, with its fraction. Requires begun().
  double pulse_at(DeviceInstant at) const { return fit_.pulse_at(to_ns(at)); }

 private:
  PulseMatch first(DeviceInstant at, uint64_t counter);

  PulseFit fit_;
  std::optional<uint64_t> counter_of_pulse_0_;
  int64_t last_pulse_ = 0;     ///< the latest that was labelled
  uint64_t last_counter_ = 0;  ///< of the frame with last_pulse_
};

}  // namespace v3d
