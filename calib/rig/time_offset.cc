#include "calib/rig/time_offset.h"

#include <algorithm>
#include <map>
#include <optional>

namespace v3d::calib {
namespace {

constexpr int kMinShared = 6;
// An offset needs more: fewer instants have a small spread by chance.
constexpr int kMinAtOffset = 10;
// Another offset must reduce the spread of the relative pose to this factor.
constexpr double kMaxSpreadRatio = 0.6;

/// The evidence for an offset: a large share of inliers, with a small spread.
struct Support {
  int inliers = 0;
  /// Of the shared instants. Runs of consecutive instants share fewer at an offset.
  double share = 0;
  double spread_m = 0;
};

Support support_at(const CandidatePoses& a, const CandidatePoses& b, int offset) {
  const PairPose pair = pair_pose(a, b, offset);
  return {pair.inliers, pair.inliers / std::max(1.0, static_cast<double>(pair.shared)),
          pair.spread_m};
}

bool clearly_better(const Support& other, const Support& own) {
  if (other.inliers < kMinAtOffset) return false;
  if (other.share > 2 * own.share) return true;
  return other.share >= 0.8 * own.share && other.spread_m < kMaxSpreadRatio * own.spread_m;
}

/// The offset of b relative to a; empty where they share too few instants.
std::optional<int> pair_offset(const CandidatePoses& a, const CandidatePoses& b) {
  const Support own = support_at(a, b, 0);
  Support best = own;
  int offset = 0;
  for (int size = 1; size <= kMaxTimeOffset; ++size) {
    for (const int sign : {1, -1}) {
      const Support other = support_at(a, b, sign * size);
      if (clearly_better(other, own) &&
          (offset == 0 || other.spread_m * best.share < best.spread_m * other.share)) {
        best = other;
        offset = sign * size;
      }
    }
  }
  if (best.inliers < kMinShared) return std::nullopt;
  return offset;
}

/// For each camera the few pairs that share most instants; each pair once.
std::vector<PairPose> closest_pairs(int cameras, std::vector<PairPose> pairs) {
  constexpr int kMaxPairs = 3;
  std::stable_sort(pairs.begin(), pairs.end(),
                   [](const PairPose& x, const PairPose& y) { return x.shared > y.shared; });
  std::vector<int> taken(cameras, 0);
  std::vector<PairPose> closest;
  for (const PairPose& pair : pairs) {
    if (taken[pair.a] >= kMaxPairs && taken[pair.b] >= kMaxPairs) continue;
    ++taken[pair.a];
    ++taken[pair.b];
    closest.push_back(pair);
  }
  return closest;
}

struct OffsetEdge {
  int a, b, offset;
};

/// Offsets along the edges, relative to the first camera of each connected component.
std::vector<std::optional<int>> propagate_offsets(int cameras,
                                                  const std::vector<OffsetEdge>& edges) {
  std::vector<std::optional<int>> offset(cameras);
  for (int start = 0; start < cameras; ++start) {
    if (offset[start]) continue;
    offset[start] = 0;
    for (bool changed = true; changed;) {
      changed = false;
      for (const OffsetEdge& edge : edges) {
        if (offset[edge.a] && !offset[edge.b]) {
          offset[edge.b] = *offset[edge.a] + edge.offset;
          changed = true;
        } else if (offset[edge.b] && !offset[edge.a]) {
          offset[edge.a] = *offset[edge.b] - edge.offset;
          changed = true;
        }
      }
    }
  }
  return offset;
}

// --- fractional offsets

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

std::vector<int> whole_time_offsets(const std::vector<CandidatePoses>& cameras,
                                    const std::vector<PairPose>& pairs) {
  std::vector<OffsetEdge> edges;
  const int count = static_cast<int>(cameras.size());
  for (const PairPose& pair : closest_pairs(count, pairs)) {
    const auto offset = pair_offset(cameras[pair.a], cameras[pair.b]);
    if (offset) edges.push_back({pair.a, pair.b, *offset});
  }
  const auto offset = propagate_offsets(count, edges);
  std::map<int, int> votes;
  for (const auto& l : offset) ++votes[*l];
  const auto most_frequent = std::max_element(
      votes.begin(), votes.end(), [](const auto& a, const auto& b) { return a.second < b.second; });
  std::vector<int> result;
  for (const auto& l : offset) result.push_back(*l - (votes.empty() ? 0 : most_frequent->first));
  return result;
}

void number_alike(const Board& board, CameraObservations& camera) {
  const BoardObservation* previous = nullptr;
  for (auto& [instant, observation] : camera.observations) {
    if (previous) observation = turned_like(*previous, board, observation);
    previous = &observation;
  }
}

std::optional<Eigen::Vector2d> corner_velocity(
    const std::map<int64_t, BoardObservation>& observations, int64_t instant, int corner) {
  const auto previous = corner_at(observations, instant - 1, corner);
  const auto next = corner_at(observations, instant + 1, corner);
  if (previous && next) return 0.5 * (*next - *previous);
  const auto here = corner_at(observations, instant, corner);
  if (!here) return std::nullopt;
  if (next) return *next - *here;
  if (previous) return *here - *previous;
  return std::nullopt;
}

double fractional_time_offset(std::span<const MovingCorner> corners) {
  constexpr size_t kMinCorners = 50;
  constexpr double kMinExplained = 0.1;
  constexpr double kMinPx = 0.02;  // RMS of the part that the motion explains
  double along = 0, speed = 0, all = 0;
  for (const MovingCorner& corner : corners) {
    along += corner.velocity.dot(corner.residual);
    speed += corner.velocity.squaredNorm();
    all += corner.residual.squaredNorm();
  }
  if (corners.size() < kMinCorners || !(speed > static_cast<double>(corners.size()))) return 0;
  const double min_explained =
      std::max(kMinExplained * all, kMinPx * kMinPx * double(corners.size()));
  if (!(along * along > speed * min_explained)) return 0;
  // A corner observed ahead of its projection, along its motion, means an early image.
  return -along / speed;
}

}  // namespace v3d::calib
