#include "capture/segmentation/flicker.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <vector>

namespace v3d::segmentation {
namespace {

constexpr size_t kMinPictures = 8;
constexpr double kMinGrey = 2;
constexpr double kFalseAlarms = 1e-3;
/// Steps of the frequency within the resolution of the series: fine enough for the amplitude.
constexpr int kStepsPerBin = 16;
constexpr double kMainsFlickerHz[] = {100, 120};

/// Sums of the normal equations of y = a cos + b sin + c.
struct Fit {
  double amplitude = 0;
  double explained = 0;  ///< share of the variance, 0 to 1
};

/// `y`: brightness minus its mean.
Fit fit_sinusoid(std::span<const double> t, std::span<const double> y, double hz) {
  double c = 0, s = 0, cc = 0, ss = 0, cs = 0, yc = 0, ys = 0, yy = 0;
  for (size_t i = 0; i < t.size(); ++i) {
    const double angle = 2 * std::numbers::pi * hz * t[i];
    const double cosine = std::cos(angle);
    const double sine = std::sin(angle);
    c += cosine;
    s += sine;
    cc += cosine * cosine;
    ss += sine * sine;
    cs += cosine * sine;
    yc += y[i] * cosine;
    ys += y[i] * sine;
    yy += y[i] * y[i];
  }
  // The constant is eliminated; the sum of y is 0.
  const auto n = static_cast<double>(t.size());
  cc -= c * c / n;
  ss -= s * s / n;
  cs -= c * s / n;
  const double determinant = cc * ss - cs * cs;
  if (yy <= 0) return {};
  double a = 0;
  double b = 0;
  if (determinant > 1e-9 * n * n) {
    a = (yc * ss - ys * cs) / determinant;
    b = (ys * cc - yc * cs) / determinant;
  } else if (cc > 0) {  // half of the pulse rate: the sine is 0 at every pulse
    a = yc / cc;
  }
  return {std::hypot(a, b), (a * yc + b * ys) / yy};
}

}  // namespace

std::optional<Flicker> measure_flicker(std::span<const PulseBrightness> series, double rate_hz) {
  if (series.size() < kMinPictures) return {};
  series = series.last(std::min(series.size(), kMaxFlickerPictures));
  double mean = 0;
  int64_t first = series.front().pulse;
  int64_t last = first;
  for (const PulseBrightness& picture : series) {
    mean += picture.grey / static_cast<double>(series.size());
    first = std::min(first, picture.pulse);
    last = std::max(last, picture.pulse);
  }
  if (mean < kMinGrey || last == first) return {};
  std::vector<double> t;
  std::vector<double> y;
  for (const PulseBrightness& picture : series) {
    t.push_back(static_cast<double>(picture.pulse - first) / rate_hz);
    y.push_back(picture.grey - mean);
  }
  const double bin_hz = rate_hz / static_cast<double>(last - first + 1);
  Fit best;
  double best_hz = 0;
  const int steps = static_cast<int>(std::ceil(kStepsPerBin * rate_hz / 2 / bin_hz));
  for (int step = kStepsPerBin / 2; step <= steps; ++step) {
    const double hz = std::min(step * bin_hz / kStepsPerBin, rate_hz / 2);
    const Fit fit = fit_sinusoid(t, y, hz);
    if (fit.explained > best.explained) {
      best = fit;
      best_hz = hz;
    }
  }
  // With noise alone, the explained share of one frequency exceeds z with probability
  // (1 - z)^((n - 3) / 2). There are about n / 2 independent frequencies.
  const auto n = static_cast<double>(series.size());
  const double limit = 1 - std::pow(2 * kFalseAlarms / n, 2 / (n - 3));
  if (best.explained < limit) return {};
  return Flicker{best.amplitude / mean, best_hz};
}

std::optional<double> rate_without_flicker(double beat_hz, double rate_hz, double tolerance_hz) {
  std::optional<double> best;
  for (const double lamp_hz : kMainsFlickerHz) {
    const double periods = std::round(lamp_hz / rate_hz);
    const double beat = std::abs(lamp_hz - periods * rate_hz);
    if (periods < 1 || std::abs(beat - beat_hz) > tolerance_hz) continue;
    const double rate = lamp_hz / periods;
    if (!best || std::abs(rate - rate_hz) < std::abs(*best - rate_hz)) best = rate;
  }
  return best;
}

}  // namespace v3d::segmentation
