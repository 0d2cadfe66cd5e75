// Signals of pulse trains for tests.
#pragma once

#include <cmath>
#include <random>
#include <vector>

#include "sound/sound_device.h"

namespace v3d::test {

/// Adds a pulse from `edge` on, in samples, with edges that a converter can represent: the steps
/// are Gaussian, with a standard deviation of one sample.
inline void add_pulse(std::vector<float>& signal, double edge, double width, double height) {
  const auto first = static_cast<int64_t>(std::floor(edge)) - 8;
  const auto last = static_cast<int64_t>(std::ceil(edge + width)) + 8;
  for (int64_t i = std::max<int64_t>(0, first); i < std::min<int64_t>(std::ssize(signal), last);
       ++i) {
    const double at = static_cast<double>(i) - edge;
    signal[static_cast<size_t>(i)] += static_cast<float>(height * sound::pulse_value(at, width));
  }
}

inline void add_noise(std::vector<float>& signal, double deviation, std::mt19937& random) {
  std::normal_distribution<float> noise(0, static_cast<float>(deviation));
  for (float& value : signal) value += noise(random);
}

/// Removes the mean as the input of a sound card does: a high-pass filter of first order.
inline void remove_mean(std::vector<float>& signal, double corner_hz, double rate_hz) {
  const double keep = std::exp(-2 * 3.14159265358979 * corner_hz / rate_hz);
  double before = 0, out = 0;
  for (float& value : signal) {
    out = keep * (out + value - before);
    before = value;
    value = static_cast<float>(out);
  }
}

}  // namespace v3d::test
