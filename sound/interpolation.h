// Band-limited interpolation between samples.
#pragma once

#include <array>
#include <cstdint>
#include <span>

namespace v3d::sound {

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
