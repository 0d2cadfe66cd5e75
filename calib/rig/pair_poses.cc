#include "calib/rig/pair_poses.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numeric>
#include <optional>

#include "base/statistics.h"

namespace v3d::calib {
namespace {

constexpr double kSameAngle = 4.0 * 3.14159265358979 / 180;
constexpr double kSameDistance = 0.05;  // of the distance to the board
// A pose that misses by so much more than the better one is not what was seen.
constexpr double kAmbiguous = 2.5;
constexpr size_t kMostInstants = 60;

/// A shared instant's opinions on b_from_a, and how far the board was.
struct Opinion {
  std::vector<RigidTransform> b_from_a;
  double distance = 0;
};

bool same_direction(const Eigen::Matrix3d& a, const Eigen::Matrix3d& b) {
  static const double kLeastTrace = 1 + 2 * std::cos(kSameAngle);
  return a.cwiseProduct(b).sum() >= kLeastTrace;  // the trace of a^T b
}

std::vector<Opinion> opinions(const CameraPoses& a, const CameraPoses& b, int64_t b_is_late) {
  std::vector<Opinion> all;
  for (const auto& [instant, poses_a] : a) {
    const auto found = b.find(instant + b_is_late);
    if (found == b.end()) continue;
    Opinion opinion;
    for (const RigidTransform& pose_a : poses_a) {
      for (const RigidTransform& pose_b : found->second) {
        opinion.b_from_a.push_back(pose_b * pose_a.inverse());
        opinion.distance = std::max(pose_a.translation.norm(), pose_b.translation.norm());
      }
    }
    if (!opinion.b_from_a.empty()) all.push_back(std::move(opinion));
  }
  return all;
}

/// The opinion of the instant that is nearest to `pose`, where one is near.
const RigidTransform* agreeing(const Opinion& opinion, const RigidTransform& pose) {
  const RigidTransform* best = nullptr;
  // A small turn at one camera moves the other along an arc.
  double least = (kSameDistance + kSameAngle) * opinion.distance;
  for (const RigidTransform& other : opinion.b_from_a) {
    if (!same_direction(other.rotation, pose.rotation)) continue;
    const double apart = (other.translation - pose.translation).norm();
    if (apart > least) continue;
    least = apart;
    best = &other;
  }
  return best;
}

std::vector<const RigidTransform*> supporters(const std::vector<const Opinion*>& opinions,
                                              const RigidTransform& pose) {
  std::vector<const RigidTransform*> result;
  for (const Opinion* opinion : opinions) {
    if (const RigidTransform* near = agreeing(*opinion, pose)) result.push_back(near);
  }
  return result;
}

/// Rotation: mean quaternion. Translation: median by axis.
RigidTransform middle_of(const std::vector<const RigidTransform*>& poses) {
  Eigen::Vector4d sum = Eigen::Vector4d::Zero();
  const Eigen::Vector4d first = Eigen::Quaterniond(poses.front()->rotation).coeffs();
  std::vector<double> axes[3];
  for (const RigidTransform* pose : poses) {
    const Eigen::Vector4d q = Eigen::Quaterniond(pose->rotation).coeffs();
    sum += q.dot(first) < 0 ? Eigen::Vector4d(-q) : q;
    for (int i = 0; i < 3; ++i) axes[i].push_back(pose->translation[i]);
  }
  const Eigen::Quaterniond mean(Eigen::Vector4d(sum.normalized()));
  return {mean.toRotationMatrix(),
          {upper_median(axes[0]), upper_median(axes[1]), upper_median(axes[2])}};
}

/// About `most` of them, evenly.
std::vector<const Opinion*> spread_out(const std::vector<Opinion>& all, size_t most) {
  std::vector<const Opinion*> some;
  const size_t step = (all.size() + most - 1) / most;
  for (size_t i = 0; i < all.size(); i += step) some.push_back(&all[i]);
  return some;
}

}  // namespace

CameraPoses possible_poses(const CameraModel& lens, const Board& board,
                           const CameraObservations& camera) {
  CameraPoses result;
  for (const auto& [instant, observation] : camera.observations) {
    std::vector<BoardPose> poses = board_poses(lens, board, observation);
    if (board.has_half_turn_symmetry()) {
      const auto other_end = board_poses(lens, board, half_turned(board, observation));
      poses.insert(poses.end(), other_end.begin(), other_end.end());
    }
    if (poses.empty()) continue;
    double least = poses.front().rms_px;
    for (const BoardPose& pose : poses) least = std::min(least, pose.rms_px);
    for (const BoardPose& pose : poses) {
      if (pose.rms_px <= kAmbiguous * least + 1e-6) result[instant].push_back(pose.cam_from_board);
    }
  }
  return result;
}

PairPose pair_pose(const CameraPoses& a, const CameraPoses& b, int64_t b_is_late) {
  const std::vector<Opinion> all = opinions(a, b, b_is_late);
  PairPose result;
  result.shared = static_cast<int>(all.size());
  if (all.empty()) return result;
  std::vector<const RigidTransform*> best;
  const std::vector<const Opinion*> some = spread_out(all, kMostInstants);
  for (const Opinion* opinion : some) {
    for (const RigidTransform& pose : opinion->b_from_a) {
      auto found = supporters(some, pose);
      if (found.size() > best.size()) best = std::move(found);
    }
  }
  result.b_from_a = middle_of(best);
  best = supporters(spread_out(all, all.size()), result.b_from_a);
  result.agreeing = static_cast<int>(best.size());
  std::vector<double> apart;
  for (const RigidTransform* pose : best) {
    apart.push_back((pose->translation - result.b_from_a.translation).norm());
  }
  result.spread_m = upper_median(std::move(apart));
  return result;
}

std::vector<PairPose> pair_poses(const std::vector<CameraPoses>& cameras) {
  std::vector<PairPose> pairs;
  for (size_t a = 0; a < cameras.size(); ++a) {
    for (size_t b = a + 1; b < cameras.size(); ++b) {
      PairPose pair = pair_pose(cameras[a], cameras[b]);
      if (pair.shared == 0) continue;
      pair.a = static_cast<int>(a);
      pair.b = static_cast<int>(b);
      pairs.push_back(pair);
    }
  }
  return pairs;
}

RigTree spanning_tree(int cameras, const std::vector<PairPose>& pairs) {
  std::vector<int> ties(cameras, 0);
  for (const PairPose& pair : pairs) {
    ties[pair.a] += pair.agreeing;
    ties[pair.b] += pair.agreeing;
  }
  RigTree tree;
  tree.root = static_cast<int>(std::max_element(ties.begin(), ties.end()) - ties.begin());
  std::vector<bool> in(cameras, false);
  in[tree.root] = true;
  while (true) {
    const PairPose* best = nullptr;
    for (const PairPose& pair : pairs) {
      if (in[pair.a] == in[pair.b] || pair.agreeing < kFewestAgreeing) continue;
      if (!best || pair.agreeing > best->agreeing) best = &pair;
    }
    if (!best) return tree;
    const bool forward = in[best->a];
    tree.edges.push_back({forward ? best->a : best->b, forward ? best->b : best->a,
                          forward ? best->b_from_a : best->b_from_a.inverse(), best->agreeing});
    in[best->a] = in[best->b] = true;
  }
}

std::vector<std::vector<int>> connected_groups(int cameras, const std::vector<PairPose>& pairs) {
  std::vector<int> group(cameras);
  std::iota(group.begin(), group.end(), 0);
  for (const PairPose& pair : pairs) {
    if (pair.agreeing < kFewestAgreeing || group[pair.a] == group[pair.b]) continue;
    std::replace(group.begin(), group.end(), int(group[pair.b]), int(group[pair.a]));
  }
  std::map<int, std::vector<int>> members;
  for (int i = 0; i < cameras; ++i) members[group[i]].push_back(i);
  std::vector<std::vector<int>> groups;
  for (auto& [id, list] : members) groups.push_back(std::move(list));
  std::stable_sort(groups.begin(), groups.end(),
                   [](const auto& a, const auto& b) { return a.size() > b.size(); });
  return groups;
}

}  // namespace v3d::calib
