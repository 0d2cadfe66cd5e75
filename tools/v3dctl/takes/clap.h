// The offset between sound and pictures of a take, by a clap.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "base/image/image.h"
#include "take/take.h"

namespace v3d::ctl {

/// How much two images of one camera differ: mean absolute difference of the bytes of every fourth
/// row, 0 to 255. Requires images of one size and format.
double image_change(ImageView a, ImageView b);

/// The end of a motion in `changes`: changes[k] is the change from picture k - 1 to picture k, for
/// k >= 1. The motion goes on at one speed and stops between two pictures, as hands do that clap:
/// the part of the last change tells where. Result in pictures, with a fraction; empty where no
/// motion stops, or one that is less than five times the change of the stillest quarter of the
/// pictures.
std::optional<double> stop_of_motion(std::span<const double> changes);

/// A clap in a take.
struct TakeClap {
  double sound_pulse = 0;  ///< position of its sound, pulses
  /// Of the stop of the motion, pulses: the median of the cameras. Empty: no camera shows it.
  std::optional<double> picture_pulse;
  int64_t cameras = 0;  ///< that show it
  double rate_hz = 25;

  /// The sound is later than the pictures by this, s. Requires picture_pulse.
  double offset_s() const { return (sound_pulse - *picture_pulse) / rate_hz; }
  /// The pictures show the clap to half a period.
  double uncertainty_s() const { return 0.5 / rate_hz; }
};

/// Finds the clap in the sound of a take, and the motion that stops within half a second of it in
/// the frames. Empty where the sound has none. Throws InputError for a take whose sound has no map
/// of pulses, and for files that cannot be read.
std::optional<TakeClap> find_take_clap(const take::TakePaths& paths);

}  // namespace v3d::ctl
