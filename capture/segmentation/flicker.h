// Flicker of lamps in the brightness of pictures, and pulse rates without it.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

namespace v3d::segmentation {

/// Mean grey value of the picture of one pulse.
struct PulseBrightness {
  int64_t pulse = 0;
  double grey = 0;
};

/// The beat between lamps and pulses: brightness = mean * (1 + amplitude * sin(2 pi beat_hz t)).
struct Flicker {
  double amplitude = 0;  ///< share of the mean brightness
  double beat_hz = 0;    ///< above 0, at most half of the pulse rate
};

/// Longer series count from their end: the time to fit grows with the square of the length, and the
/// daemon waits for it.
inline constexpr size_t kMaxFlickerPictures = 512;

/// Fits a sinusoid to the brightness over the pulses by least squares, of the last
/// kMaxFlickerPictures. `rate_hz`: pulses per second. Pulses may be missing. A frequency below half
/// a period of the whole series is not searched. Empty for fewer than 8 pictures, dark pictures,
/// and where noise alone would explain as much of the brightness in one of 1000 series. Pure
/// function. A person who moves changes the brightness too, so the studio should be empty. Source:
/// Lomb, "Least-squares frequency analysis of unequally spaced data", 1976; significance: Scargle,
/// 1982, with the variance estimated from the series.
std::optional<Flicker> measure_flicker(std::span<const PulseBrightness> series, double rate_hz);

/// The pulse rate nearest to `rate_hz` at which the lamps that cause the beat have none: a whole
/// fraction of their 100 or 120 Hz, twice the frequency of the mains. Empty if neither frequency
/// causes this beat within `tolerance_hz`, or `rate_hz` is above the frequency of the lamps.
std::optional<double> rate_without_flicker(double beat_hz, double rate_hz, double tolerance_hz);

}  // namespace v3d::segmentation
