// Detector of the pulses of the trigger in a sound channel, and the interpolation that it uses.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

namespace v3d::sound {

/// Finds the leading edges of pulses in one channel, to a fraction of a sample.
///
/// A pulse is a short excursion from the idle level, of either polarity: a pulse train that is high
/// for less than half of its period. Sound inputs remove the mean of a signal, and cables may
/// invert it; therefore levels and polarity are measured. In each window of 0.5 s the idle level is
/// the median, the noise its median absolute deviation, and the height of a pulse the median over
/// the pulses. An edge crosses half of that height. A new edge needs a return below a quarter of it
/// (hysteresis).
///
/// The position between two samples is where the band-limited signal (interpolate())
/// crosses the threshold. Source of the hysteresis: Schmitt, "A thermionic trigger" (1938).
///
/// Windows without pulses, with hum or with noise alone give no edges. Single clicks may: the
/// caller compares edges with the train (PulseMap, SampleClock). One thread.
class PulseEdgeDetector {
 public:
  explicit PulseEdgeDetector(int rate_hz);

  /// Adds the next samples of the channel, full scale -1 to 1. Returns the positions of edges,
  /// ascending; position 0 is the first sample. An edge is returned at most 0.6 s of samples later.
  std::vector<double> push(std::span<const float> samples);
  /// The remaining edges, at the end of the signal.
  std::vector<double> finish();

  /// All edges before this position were returned, samples.
  double searched() const { return static_cast<double>(start_ + next_); }
  /// The height of the pulses of the last window with pulses, of full scale; 0 before the first.
  double height() const { return height_; }

 private:
  struct Levels {
    double idle = 0;
    double noise = 0;  ///< standard deviation
  };
  /// A run of samples on one side of the idle level, far outside of the noise.
  struct Excursion {
    int side = 0;  ///< 1 above the idle level, -1 below
    double height =
        0;  ///< median distance from the idle level, of the samples above half of the peak
    int64_t samples = 0;
    bool is_cut =
        false;  ///< begins or ends outside of the window: its height is not that of a pulse
  };

  void search_window(int64_t end, std::vector<double>& edges);
  Levels levels_of(int64_t begin, int64_t end) const;
  std::vector<Excursion> excursions(const Levels& levels, int64_t begin, int64_t end) const;
  /// Updates polarity_ and height_. False when the window has no pulses of this height.
  bool measure_pulses(std::vector<Excursion> found);
  void find_edges(double idle, int64_t end, std::vector<double>& edges);
  /// Where the interpolated signal reaches `threshold` between the samples index - 1 and index.
  double crossing(int64_t index, double threshold) const;

  const int64_t window_;       ///< samples
  std::vector<float> buffer_;  ///< samples from position start_ on
  int64_t start_ = 0;          ///< position of buffer_[0]
  int64_t next_ = 0;           ///< index of the first sample that was not searched
  double side_votes_ = 0;      ///< sign: the polarity of the pulses
  double height_ = 0;
  int strange_windows_ = 0;  ///< consecutive windows with pulses of another height
  bool is_high_ = false;
};

// Band-limited interpolation between samples.

/// Half width of the interpolation kernel, samples.
inline constexpr int64_t kKernel = 16;

/// Weights of the 2 * kKernel samples around a position: weight i belongs to sample
/// floor(position) - kKernel + 1 + i. Their sum is 1.
///
/// A sinc with a Hann window. Source: Smith and Gossett, "A flexible sampling-rate conversion
/// method" (ICASSP 1984).
std::array<double, 2 * kKernel> interpolation_weights(double position);

/// The band-limited signal at `index`, samples. Outside of `samples` the signal continues with its
/// first or last value. Requires at least one sample.
double interpolate(std::span<const float> samples, double index);

}  // namespace v3d::sound
