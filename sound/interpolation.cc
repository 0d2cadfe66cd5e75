#include "sound/interpolation.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace v3d::sound {
namespace {

double windowed_sinc(double x) {
  if (std::abs(x) < 1e-9) return 1;
  if (std::abs(x) >= kKernel) return 0;
  const double angle = std::numbers::pi * x;
  return std::sin(angle) / angle * (0.5 + 0.5 * std::cos(angle / kKernel));
}

}  // namespace

std::array<double, 2 * kKernel> interpolation_weights(double position) {
  const double first = std::floor(position) - kKernel + 1;
  std::array<double, 2 * kKernel> weights{};
  double sum = 0;
  for (size_t i = 0; i < weights.size(); ++i) {
    weights[i] = windowed_sinc(position - first - static_cast<double>(i));
    sum += weights[i];
  }
  for (double& weight : weights) weight /= sum;
  return weights;
}

double interpolate(std::span<const float> samples, double index) {
  const auto weights = interpolation_weights(index);
  const auto first = static_cast<int64_t>(std::floor(index)) - kKernel + 1;
  double sum = 0;
  for (int64_t i = 0; i < std::ssize(weights); ++i) {
    const int64_t inside = std::clamp<int64_t>(first + i, 0, std::ssize(samples) - 1);
    sum += weights[static_cast<size_t>(i)] * samples[static_cast<size_t>(inside)];
  }
  return sum;
}

}  // namespace v3d::sound
