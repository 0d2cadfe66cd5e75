#include "calib/rig/time_offset.h"

#include <algorithm>
#include <map>
#include <optional>

namespace v3d::calib {
namespace {

constexpr int kFewestShared = 6;
// Another offset must fit so much better: the spread of what the instants say halves, about.
constexpr double kClearlyBetter = 0.6;

/// What speaks for an offset: many instants that agree, closely.
struct Support {
  int agreeing = 0;
  double spread_m = 0;
};

Support support_at(const CameraPoses& a, const CameraPoses& b, int late) {
  const PairPose pair = pair_pose(a, b, late);
  return {pair.agreeing, pair.spread_m};
}

bool clearly_better(const Support& other, const Support& own) {
  if (other.agreeing < kFewestShared) return false;
  if (other.agreeing > 2 * own.agreeing) return true;
  return other.agreeing * 10 >= own.agreeing * 8 && other.spread_m < kClearlyBetter * own.spread_m;
}

/// How late b is against a; empty where they share too little to tell.
std::optional<int> pair_late(const CameraPoses& a, const CameraPoses& b) {
  const Support own = support_at(a, b, 0);
  Support best = own;
  int late = 0;
  for (int size = 1; size <= kMostInstantsOff; ++size) {
    for (const int sign : {1, -1}) {
      const Support other = support_at(a, b, sign * size);
      if (clearly_better(other, own) &&
          (late == 0 || other.spread_m * best.agreeing < best.spread_m * other.agreeing)) {
        best = other;
        late = sign * size;
      }
    }
  }
  if (best.agreeing < kFewestShared) return std::nullopt;
  return late;
}

/// Of every camera the few pairs that share most, each pair once.
std::vector<PairPose> closest_pairs(int cameras, std::vector<PairPose> pairs) {
  constexpr int kFew = 3;
  std::stable_sort(pairs.begin(), pairs.end(),
                   [](const PairPose& x, const PairPose& y) { return x.shared > y.shared; });
  std::vector<int> taken(cameras, 0);
  std::vector<PairPose> closest;
  for (const PairPose& pair : pairs) {
    if (taken[pair.a] >= kFew && taken[pair.b] >= kFew) continue;
    ++taken[pair.a];
    ++taken[pair.b];
    closest.push_back(pair);
  }
  return closest;
}

struct Tie {
  int a, b, late;
};

/// Along the ties from the first camera of each group.
std::vector<std::optional<int>> follow(int cameras, const std::vector<Tie>& ties) {
  std::vector<std::optional<int>> late(cameras);
  for (int start = 0; start < cameras; ++start) {
    if (late[start]) continue;
    late[start] = 0;
    for (bool grew = true; grew;) {
      grew = false;
      for (const Tie& tie : ties) {
        if (late[tie.a] && !late[tie.b]) {
          late[tie.b] = *late[tie.a] + tie.late;
          grew = true;
        } else if (late[tie.b] && !late[tie.a]) {
          late[tie.a] = *late[tie.b] - tie.late;
          grew = true;
        }
      }
    }
  }
  return late;
}

}  // namespace

std::vector<int> instants_late(const std::vector<CameraPoses>& cameras,
                               const std::vector<PairPose>& pairs) {
  std::vector<Tie> ties;
  const int count = static_cast<int>(cameras.size());
  for (const PairPose& pair : closest_pairs(count, pairs)) {
    const auto late = pair_late(cameras[pair.a], cameras[pair.b]);
    if (late) ties.push_back({pair.a, pair.b, *late});
  }
  const auto late = follow(count, ties);
  std::map<int, int> votes;
  for (const auto& l : late) ++votes[*l];
  const auto usual = std::max_element(
      votes.begin(), votes.end(), [](const auto& a, const auto& b) { return a.second < b.second; });
  std::vector<int> result;
  for (const auto& l : late) result.push_back(*l - (votes.empty() ? 0 : usual->first));
  return result;
}

}  // namespace v3d::calib
