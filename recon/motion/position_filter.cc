#include "recon/motion/position_filter.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>
#include <utility>

#include "base/core/error.h"
#include "base/core/statistics.h"
#include "recon/mesh/mesh_neighbours.h"

namespace v3d::recon {
namespace {

using Eigen::Vector3f;

// Pulses on each side of the middle of a window.
constexpr int kStillReach = 4, kMovingReach = 3, kMinMovingReach = 2;
/// A window is used whose residual is at most this many times the noise of the vertex.
constexpr float kTolerance = 1.25F;
// The noise of a vertex is at least the first, and counts up to the second: root mean square,
// metres.
constexpr float kMinNoiseM = 0.0003F, kMaxNoiseM = 0.003F;

// Of steady_displacements().
constexpr int64_t kSteadyReach = 4;       ///< pulses on each side
constexpr float kSteadyDeviation = 2.5F;  ///< of the weight over time, pulses
constexpr float kOutlierM = 0.006F;       ///< from here on a displacement does not count

/// Positions of one vertex around a pulse.
using Window = std::span<const Vector3f>;

struct Fit {
  Vector3f middle;   ///< position at the middle pulse
  float residual_m;  ///< root mean square per degree of freedom
};

Fit mean_of(Window window) {
  const auto count = static_cast<float>(window.size());
  Vector3f mean = Vector3f::Zero();
  for (const Vector3f& position : window) mean += position;
  mean /= count;
  float square = 0;
  for (const Vector3f& position : window) square += (position - mean).squaredNorm();
  return {mean, std::sqrt(square / (count - 1))};
}

/// The parabola that fits best. Requires at least four positions.
Fit parabola_of(Window window) {
  // Offsets from the middle are symmetric, so the linear term is independent of the others.
  const size_t half = window.size() / 2;
  const auto reach = static_cast<float>(half);
  const auto count = static_cast<float>(window.size());
  float t2 = 0, t4 = 0;
  Vector3f sum = Vector3f::Zero(), linear = Vector3f::Zero(), square = Vector3f::Zero();
  for (size_t i = 0; i < window.size(); ++i) {
    const Vector3f& position = window[i];
    const float t = static_cast<float>(i) - reach;
    t2 += t * t;
    t4 += t * t * t * t;
    sum += position;
    linear += t * position;
    square += t * t * position;
  }
  const float determinant = count * t4 - t2 * t2;
  const Vector3f middle = (t4 * sum - t2 * square) / determinant;
  const Vector3f bend = (count * square - t2 * sum) / determinant;
  const Vector3f speed = linear / t2;
  float residual = 0;
  for (size_t i = 0; i < window.size(); ++i) {
    const float t = static_cast<float>(i) - reach;
    const Vector3f fit = middle + t * speed + t * t * bend;
    residual += (window[i] - fit).squaredNorm();
  }
  return {middle, std::sqrt(residual / (count - 3))};
}

Window around(std::span<const Vector3f> path, size_t i, int reach) {
  const auto half = static_cast<size_t>(reach);
  return path.subspan(i - half, 2 * half + 1);
}

/// Of each pulse, the reach of the largest window around it with evenly spaced pulses. A window
/// across a gap would change the speed of a vertex.
std::vector<int> reaches_of(std::span<const int64_t> pulses) {
  std::vector<int> reaches(pulses.size(), 0);
  for (size_t i = 1; i + 1 < pulses.size(); ++i) {
    const size_t max_reach = std::min({i, pulses.size() - 1 - i, size_t{kStillReach}});
    const int64_t spacing = pulses[i + 1] - pulses[i];
    size_t reach = 0;
    while (reach < max_reach && pulses[i + reach + 1] - pulses[i + reach] == spacing &&
           pulses[i - reach] - pulses[i - reach - 1] == spacing) {
      ++reach;
    }
    reaches[i] = static_cast<int>(reach);
  }
  return reaches;
}

/// Median residual of short parabolas: short enough that most motion follows them. `reaches`: see
/// reaches_of().
float noise_of(std::span<const Vector3f> path, std::span<const int> reaches) {
  std::vector<float> residuals;
  for (size_t i = 0; i < path.size(); ++i) {
    if (reaches[i] < kMinMovingReach) continue;
    residuals.push_back(parabola_of(around(path, i, kMinMovingReach)).residual_m);
  }
  return std::clamp(upper_median(std::move(residuals)), kMinNoiseM, kMaxNoiseM);
}

/// Position at pulse `i` of a vertex whose path is `path`; `max_reach`: the largest reach of a
/// window.
Vector3f smoothed(std::span<const Vector3f> path, size_t i, int max_reach, float tolerance_m) {
  for (int reach = max_reach; reach > 0; --reach) {
    const Fit fit = mean_of(around(path, i, reach));
    if (fit.residual_m <= tolerance_m) return fit.middle;
  }
  for (int reach = std::min(max_reach, kMovingReach); reach >= kMinMovingReach; --reach) {
    const Fit fit = parabola_of(around(path, i, reach));
    if (fit.residual_m <= tolerance_m) return fit.middle;
  }
  return path[i];
}

/// Mean of the displacements of vertex `v` at the pulses `near`, weighed by their distance from the
/// pulse `number` and by their distance from the median. Returns the displacement and its weight.
std::pair<float, float> steady_displacement(std::span<const NormalDisplacements> near,
                                            std::span<const int64_t> numbers, int64_t number,
                                            size_t v) {
  std::vector<float> targets;
  for (const NormalDisplacements& pulse : near) {
    if (pulse.weight[v] > 0) targets.push_back(pulse.target[v]);
  }
  if (targets.empty()) return {0, 0};
  const float median = upper_median(std::move(targets));
  float sum = 0, weight = 0;
  for (size_t i = 0; i < near.size(); ++i) {
    const float away = static_cast<float>(numbers[i] - number) / kSteadyDeviation;
    const float share = std::min(std::abs(near[i].target[v] - median) / kOutlierM, 1.0F);
    const float inlier = (1 - share * share) * (1 - share * share);
    const float w = near[i].weight[v] * std::exp(-away * away / 2) * inlier;
    sum += w * near[i].target[v];
    weight += w;
  }
  return weight > 0 ? std::pair(sum / weight, std::min(weight, 1.0F)) : std::pair(0.0F, 0.0F);
}

}  // namespace

std::vector<NormalDisplacements> steady_displacements(std::span<const NormalDisplacements> pulses,
                                                      std::span<const int64_t> numbers) {
  V3D_CHECK(pulses.size() == numbers.size());
  std::vector<NormalDisplacements> result(pulses.begin(), pulses.end());
  for (size_t i = 0; i < pulses.size(); ++i) {
    const auto first = std::ranges::lower_bound(numbers, numbers[i] - kSteadyReach);
    const auto end = std::ranges::upper_bound(numbers, numbers[i] + kSteadyReach);
    const auto begin = static_cast<size_t>(first - numbers.begin());
    const auto count = static_cast<size_t>(end - first);
    const auto near = pulses.subspan(begin, count);
    const auto near_numbers = numbers.subspan(begin, count);
    for_each_vertex(pulses[i].target.size(), [&](size_t v) {
      const auto [target, weight] = steady_displacement(near, near_numbers, numbers[i], v);
      result[i].target[v] = target;
      result[i].weight[v] = weight;
    });
  }
  return result;
}

void smooth_in_time(std::vector<std::vector<Vector3f>>& positions,
                    std::span<const int64_t> pulses) {
  V3D_CHECK(pulses.size() == positions.size());
  if (positions.empty()) return;
  const size_t vertices = positions[0].size();
  for (const auto& pulse : positions) V3D_CHECK(pulse.size() == vertices);
  const std::vector<int> reaches = reaches_of(pulses);
  constexpr size_t kBlock = 256;
  for_each_block<kBlock>(vertices, [&](size_t begin, size_t end) {
    std::vector<Vector3f> path(positions.size());
    for (size_t v = begin; v < end; ++v) {
      for (size_t i = 0; i < path.size(); ++i) path[i] = positions[i][v];
      const float tolerance_m = kTolerance * noise_of(path, reaches);
      for (size_t i = 0; i < path.size(); ++i) {
        positions[i][v] = smoothed(path, i, reaches[i], tolerance_m);
      }
    }
  });
}

}  // namespace v3d::recon
