// Changes the duration of sound and keeps its pitch. The adapter of SoundTouch.
#pragma once

#include <memory>
#include <span>
#include <vector>

namespace v3d::ctl {

/// Stretches sound of two channels, block by block. One thread.
///
/// What was at t seconds of the input is at (t - lead_s()) / tempo seconds of the output. Between
/// tempos of 0.25 and 4, this is exact to 20 ms; sounds shorter than 20 ms may be left out.
/// Source: Roucos and Wilgus, "High quality time-scale modification for speech" (ICASSP 1985), as
/// SoundTouch implements it.
class TimeStretch {
 public:
  /// `tempo`: 2 halves the duration; 0.01 to 100. Other values are limited to this range.
  TimeStretch(int rate_hz, double tempo);
  ~TimeStretch();
  TimeStretch(TimeStretch&&) noexcept;
  TimeStretch& operator=(TimeStretch&&) noexcept;

  /// Half of the difference between a segment of the output and its share of the input: inside of a
  /// segment the sound keeps its speed.
  static double lead_s(double tempo);

  /// Adds samples, left and right in turn.
  void push(std::span<const float> samples);
  /// Fills `samples` with the next output. Returns false, and takes nothing, when it needs more
  /// input for that.
  bool pop(std::span<float> samples);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace v3d::ctl
