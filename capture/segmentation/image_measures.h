// Brightness, exposure, focus and flicker.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "base/image/image.h"
#include "capture/segmentation/background.h"

namespace v3d::segmentation {

// Brightness ratio of an image to its background model.

inline constexpr uint32_t kUnitGain =
    32768;  ///< brightness ratios are fixed-point numbers of 1/32768

/// Mode of the ratios of the image's samples to `mean` (per sample, 1/256 grey value), in units of
/// 1 / kUnitGain, limited to [0.5, 1.9]. It uses a regular subset of the samples. Samples of the
/// performer have scattered ratios and do not change the mode. kUnitGain if there are too few
/// usable samples. Pure function.
uint32_t brightness_ratio(ImageView image, std::span<const uint16_t> mean);

// Exposure and focus measures of a camera's images.

struct PictureQuality {
  double clipped = 0;    ///< share of saturated samples (250 and above)
  double dark = 0;       ///< share of samples within the noise (up to 5)
  double mean_grey = 0;  ///< grey value
  /// Variance of the Laplacian of the mean image at half size, in grey values squared. It falls
  /// steeply when the lens is out of focus. Values of different scenes are not comparable.
  /// Source: Pech-Pacheco et al., "Diatom autofocusing in brightfield microscopy", 2000.
  double focus = 0;
};

/// Accumulates images of one size and format. Focus is measured on their mean, because noise of a
/// single image would count as detail. Not thread-safe.
class PictureStatistics {
 public:
  /// Adds an image. Ignores it if its size or format differs from the first one's. Returns its mean
  /// grey value; 0 for an ignored image.
  double add(ImageView picture);
  int64_t pictures() const { return pictures_; }
  /// All zero if there was no image.
  PictureQuality result() const;

 private:
  ImageSize size_;
  PixelFormat format_ = PixelFormat::kMono8;
  int64_t pictures_ = 0;
  int64_t clipped_ = 0;
  int64_t dark_ = 0;
  int64_t sum_ = 0;
  std::vector<uint32_t> quads_;  ///< sums over the images, at half size
};

/// PictureQuality::focus of the empty studio, measured on the model's means.
double focus_of(const BackgroundModel& model);

// Flicker of lamps in the brightness of pictures, and pulse rates without it.

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
