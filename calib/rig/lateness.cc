#include "calib/rig/lateness.h"

#include <algorithm>

namespace v3d::calib {
namespace {

std::optional<Eigen::Vector2d> corner_at(const std::map<int64_t, BoardObservation>& observations,
                                         int64_t instant, int corner) {
  const auto found = observations.find(instant);
  if (found == observations.end()) return std::nullopt;
  const BoardObservation& s = found->second;
  const auto at = std::lower_bound(s.corners.begin(), s.corners.end(), corner);
  if (at == s.corners.end() || *at != corner) return std::nullopt;
  return s.pixels[static_cast<size_t>(at - s.corners.begin())];
}

}  // namespace

std::optional<Eigen::Vector2d> corner_velocity(
    const std::map<int64_t, BoardObservation>& observations, int64_t instant, int corner) {
  const auto before = corner_at(observations, instant - 1, corner);
  const auto behind = corner_at(observations, instant + 1, corner);
  if (before && behind) return 0.5 * (*behind - *before);
  const auto here = corner_at(observations, instant, corner);
  if (!here) return std::nullopt;
  if (behind) return *behind - *here;
  if (before) return *here - *before;
  return std::nullopt;
}

double part_late(std::span<const MovingCorner> corners) {
  constexpr size_t kFewest = 50;
  constexpr double kWorthIt = 0.1;
  constexpr double kLeastPx = 0.02;  // root mean square of what the motion explains
  double along = 0, speed = 0, all = 0;
  for (const MovingCorner& corner : corners) {
    along += corner.velocity.dot(corner.miss);
    speed += corner.velocity.squaredNorm();
    all += corner.miss.squaredNorm();
  }
  if (corners.size() < kFewest || !(speed > static_cast<double>(corners.size()))) return 0;
  const double least = std::max(kWorthIt * all, kLeastPx * kLeastPx * double(corners.size()));
  if (!(along * along > speed * least)) return 0;
  // Seen where it will be projected a little later: the picture is early.
  return -along / speed;
}

}  // namespace v3d::calib
