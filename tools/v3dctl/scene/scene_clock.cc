#include "v3dctl/scene/scene_clock.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace v3d::ctl {
namespace {

/// Tolerance of rounding: 0.04 s at 25 Hz is pulse 1 although 0.04 * 25 may be less than 1.
constexpr double kTolerance = 1e-6;

/// Interpolated values of a key.
using Numbers = Eigen::Matrix<double, 7, 1>;

Numbers numbers_of(const CameraKey& key) {
  Numbers numbers;
  numbers << key.eye, key.look, key.fov_deg;
  return numbers;
}

CameraKey key_of(double seconds, const Numbers& numbers) {
  return {seconds, numbers.head<3>(), numbers.segment<3>(3), std::clamp(numbers[6], 1.0, 150.0)};
}

Numbers slope(std::span<const CameraKey> keys, size_t at) {
  const CameraKey& before = keys[at > 0 ? at - 1 : 0];
  const CameraKey& behind = keys[std::min(at + 1, keys.size() - 1)];
  return (numbers_of(behind) - numbers_of(before)) / (behind.at_s - before.at_s);
}

}  // namespace

CameraKey camera_at(std::span<const CameraKey> keys, double seconds) {
  if (seconds <= keys.front().at_s) return key_of(seconds, numbers_of(keys.front()));
  if (seconds >= keys.back().at_s) return key_of(seconds, numbers_of(keys.back()));
  size_t next = 1;
  while (keys[next].at_s <= seconds) ++next;
  const double span = keys[next].at_s - keys[next - 1].at_s;
  const double u = (seconds - keys[next - 1].at_s) / span;
  const double u2 = u * u, u3 = u2 * u;
  return key_of(seconds, (2 * u3 - 3 * u2 + 1) * numbers_of(keys[next - 1]) +
                             (u3 - 2 * u2 + u) * span * slope(keys, next - 1) +
                             (3 * u2 - 2 * u3) * numbers_of(keys[next]) +
                             (u3 - u2) * span * slope(keys, next));
}

CameraModel camera_model(const CameraKey& key, ImageSize size) {
  const double focal = 0.5 * size.height / std::tan(key.fov_deg * std::numbers::pi / 360);
  Eigen::Matrix3d matrix;
  matrix << focal, 0, 0.5 * (size.width - 1), 0, focal, 0.5 * (size.height - 1), 0, 0, 1;
  return {size, matrix, Distortion{}, look_at(key.eye, key.look)};
}

std::optional<int64_t> pulse_at(const SceneTake& take, double rate_hz, int64_t first, int64_t last,
                                double seconds) {
  const int64_t in = std::clamp(take.in_pulse.value_or(first), first, last);
  const int64_t out = std::clamp(take.out_pulse.value_or(last), in, last);
  const int64_t length = out - in + 1;
  const double position = (seconds - take.start_s) * take.speed * rate_hz;
  const auto n = static_cast<int64_t>(std::floor(position + kTolerance));
  switch (take.outside) {
    case Outside::kHide:
      if (n < 0 || n >= length) return {};
      break;
    case Outside::kLoop:
      return in + ((n % length) + length) % length;
    case Outside::kHold:
      break;
  }
  return in + std::clamp<int64_t>(n, 0, length - 1);
}

}  // namespace v3d::ctl
