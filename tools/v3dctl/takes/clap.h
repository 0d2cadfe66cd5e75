// The offset between sound and pictures of a take, by a clap.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <vector>

#include "take/take.h"

namespace v3d::ctl {

/// A clap in the sound, and in the pictures of cameras.
struct ClapOffset {
  double sound_pulse = 0;          ///< position of its sound, pulses
  double sound_uncertainty_s = 0;  ///< of that position, one standard deviation
  double rate_hz = 25;             ///< of the pulses
  struct Camera {
    std::string name;
    double pulse = 0;  ///< of the stop of the motion
  };
  std::vector<Camera> cameras{};  ///< that show it

  /// Of the stop of the motion, pulses: the median of the cameras. Empty: no camera shows it.
  std::optional<double> picture_pulse() const;
  /// The sound is later by this than what was seen at a pulse, s.
  double later_than(double pulse) const { return (sound_pulse - pulse) / rate_hz; }
  /// The sound is later than the pictures by this, s. Requires picture_pulse().
  double offset_s() const { return later_than(picture_pulse().value()); }
  /// The pictures show the clap to half a period.
  double uncertainty_s() const { return 0.5 / rate_hz + sound_uncertainty_s; }
};

/// "clap at pulse 30.30; the sound is 12 ms later than the pictures, +-20 ms, by 4 cameras", or
/// that no camera shows it.
std::string clap_text(const ClapOffset& clap);
/// {sound_pulse, picture_pulse, cameras (count), offset_ms, uncertainty_ms}; null where unknown.
nlohmann::ordered_json clap_json(const std::optional<ClapOffset>& clap);

/// Finds the clap in the sound of a take, and the motion that stops within half a second of it in
/// the frames. Empty where the sound has none. Throws InputError for a take whose sound has no map
/// of pulses, and for files that cannot be read.
std::optional<ClapOffset> find_take_clap(const take::TakePaths& paths);

}  // namespace v3d::ctl
