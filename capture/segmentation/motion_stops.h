// Detects stops of motion in the pictures of a camera, such as those of hands that clap.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "base/image/image.h"

namespace v3d::segmentation {

/// How much two images of one camera differ: the sum of the differences of bytes that exceed the
/// noise of a camera (16 of 255), by the number of all bytes; 0 to 255.
/// Requires images of one size and of one format of 8 bits.
double image_change(ImageView a, ImageView b);

/// The end of a motion.
struct MotionStop {
  double pulse = 0;   ///< with a fraction
  double change = 0;  ///< image_change() from pulse to pulse during the motion
};

/// The ends of motions in `changes`, ascending: changes[k] is the change from picture k - 1 to
/// picture k, for k >= 1; MotionStop::pulse counts pictures. `rate_hz`: pictures per second.
///
/// Model: constant speed, then a stop between two pictures, as of hands that clap. The last change
/// divided by the change before it, both less the change after the stop, is the fraction of the
/// picture interval at which the motion stopped. The change during a motion is at least five times
/// that of the stillest quarter of the pictures within half a second. No larger motion stops within
/// 0.1 s.
std::vector<MotionStop> stops_of_motion(std::span<const double> changes, double rate_hz);

/// The pictures of one camera, of which it keeps the changes. One thread.
class MotionSeries {
 public:
  static constexpr size_t kMaxStops = 32;

  /// Adds the picture of a pulse. Pulses must ascend, others are ignored. No motion stops in a gap,
  /// and between pictures of different sizes or formats. The image has a format of 8 bits.
  void add(int64_t pulse, ImageView picture);

  /// The stops of motion, at most the kMaxStops greatest. `rate_hz`: of the pulses.
  std::vector<MotionStop> stops(double rate_hz) const;

 private:
  /// Changes between the pictures of consecutive pulses.
  struct Run {
    int64_t first = 0;            ///< pulse of its first picture
    std::vector<double> changes;  ///< as for stops_of_motion(); [0] is 0
  };

  Image last_;
  std::vector<Run> runs_;
};

/// The greatest of the stops within half a second of a pulse; empty without one.
std::optional<MotionStop> stop_near(std::span<const MotionStop> stops, double pulse,
                                    double rate_hz);

}  // namespace v3d::segmentation
