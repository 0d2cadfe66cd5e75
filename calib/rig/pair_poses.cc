#include "calib/rig/pair_poses.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>
#include <optional>
#include <utility>

#include "base/core/statistics.h"
#include "calib/boards/board.h"

namespace v3d::calib {
namespace {

constexpr double kMaxAngle = 4.0 * 3.14159265358979 / 180;
constexpr double kMaxDistance = 0.05;  // of the distance to the board
// A pose whose error exceeds that of the best pose by this factor is not a candidate.
constexpr double kMaxAmbiguousRatio = 2.5;
constexpr size_t kMaxInstants = 60;

/// The candidates for b_from_a of one shared instant, and the distance of its board.
struct PoseCandidates {
  std::vector<RigidTransform> b_from_a;
  double distance = 0;
};

bool same_direction(const Eigen::Matrix3d& a, const Eigen::Matrix3d& b) {
  static const double kMinTrace = 1 + 2 * std::cos(kMaxAngle);
  return a.cwiseProduct(b).sum() >= kMinTrace;  // the trace of a^T b
}

std::vector<PoseCandidates> candidates_by_instant(const CandidatePoses& a, const CandidatePoses& b,
                                                  int64_t b_offset) {
  std::vector<PoseCandidates> all;
  for (const auto& [instant, poses_a] : a) {
    const auto found = b.find(instant + b_offset);
    if (found == b.end()) continue;
    PoseCandidates candidates;
    for (const RigidTransform& pose_a : poses_a) {
      for (const RigidTransform& pose_b : found->second) {
        candidates.b_from_a.push_back(pose_b * pose_a.inverse());
        candidates.distance = std::max(pose_a.translation.norm(), pose_b.translation.norm());
      }
    }
    if (!candidates.b_from_a.empty()) all.push_back(std::move(candidates));
  }
  return all;
}

/// The candidate nearest to `pose`, or null where none is within the tolerances.
const RigidTransform* nearest_inlier(const PoseCandidates& candidates, const RigidTransform& pose) {
  const RigidTransform* best = nullptr;
  // A small rotation of one camera moves the other along an arc.
  double smallest = (kMaxDistance + kMaxAngle) * candidates.distance;
  for (const RigidTransform& other : candidates.b_from_a) {
    if (!same_direction(other.rotation, pose.rotation)) continue;
    const double distance = (other.translation - pose.translation).norm();
    if (distance > smallest) continue;
    smallest = distance;
    best = &other;
  }
  return best;
}

std::vector<const RigidTransform*> find_inliers(const std::vector<const PoseCandidates*>& instants,
                                                const RigidTransform& pose) {
  std::vector<const RigidTransform*> result;
  for (const PoseCandidates* candidates : instants) {
    if (const RigidTransform* inlier = nearest_inlier(*candidates, pose)) result.push_back(inlier);
  }
  return result;
}

/// Rotation: mean quaternion. Translation: median by axis.
RigidTransform mean_pose(const std::vector<const RigidTransform*>& poses) {
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

/// About `max_count` instants, evenly spaced.
std::vector<const PoseCandidates*> subsample(const std::vector<PoseCandidates>& all,
                                             size_t max_count) {
  std::vector<const PoseCandidates*> some;
  const size_t step = (all.size() + max_count - 1) / max_count;
  for (size_t i = 0; i < all.size(); i += step) some.push_back(&all[i]);
  return some;
}

}  // namespace

CandidatePoses candidate_poses(const CameraModel& lens, const Board& board,
                               const CameraObservations& camera) {
  CandidatePoses result;
  for (const auto& [instant, observation] : camera.observations) {
    std::vector<BoardPose> poses = board_poses(lens, board, observation);
    if (board.has_half_turn_symmetry()) {
      const auto other_end = board_poses(lens, board, half_turned(board, observation));
      poses.insert(poses.end(), other_end.begin(), other_end.end());
    }
    if (poses.empty()) continue;
    double smallest = poses.front().rms_px;
    for (const BoardPose& pose : poses) smallest = std::min(smallest, pose.rms_px);
    for (const BoardPose& pose : poses) {
      if (pose.rms_px <= kMaxAmbiguousRatio * smallest + 1e-6)
        result[instant].push_back(pose.cam_from_board);
    }
  }
  return result;
}

PairPose pair_pose(const CandidatePoses& a, const CandidatePoses& b, int64_t b_offset) {
  const std::vector<PoseCandidates> all = candidates_by_instant(a, b, b_offset);
  PairPose result;
  result.shared = static_cast<int>(all.size());
  if (all.empty()) return result;
  std::vector<const RigidTransform*> best;
  const std::vector<const PoseCandidates*> some = subsample(all, kMaxInstants);
  for (const PoseCandidates* candidates : some) {
    for (const RigidTransform& pose : candidates->b_from_a) {
      auto found = find_inliers(some, pose);
      if (found.size() > best.size()) best = std::move(found);
    }
  }
  result.b_from_a = mean_pose(best);
  best = find_inliers(subsample(all, all.size()), result.b_from_a);
  result.inliers = static_cast<int>(best.size());
  std::vector<double> distances;
  for (const RigidTransform* pose : best) {
    distances.push_back((pose->translation - result.b_from_a.translation).norm());
  }
  result.spread_m = upper_median(std::move(distances));
  return result;
}

std::vector<PairPose> pair_poses(const std::vector<CandidatePoses>& cameras) {
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
  std::vector<int> degree(cameras, 0);
  for (const PairPose& pair : pairs) {
    degree[pair.a] += pair.inliers;
    degree[pair.b] += pair.inliers;
  }
  RigTree tree;
  tree.root = static_cast<int>(std::max_element(degree.begin(), degree.end()) - degree.begin());
  std::vector<bool> in(cameras, false);
  in[tree.root] = true;
  while (true) {
    const PairPose* best = nullptr;
    for (const PairPose& pair : pairs) {
      if (in[pair.a] == in[pair.b] || pair.inliers < kMinInliers) continue;
      if (!best || pair.inliers > best->inliers) best = &pair;
    }
    if (!best) return tree;
    const bool forward = in[best->a];
    tree.edges.push_back({forward ? best->a : best->b, forward ? best->b : best->a,
                          forward ? best->b_from_a : best->b_from_a.inverse(), best->inliers});
    in[best->a] = in[best->b] = true;
  }
}

std::vector<std::vector<int>> connected_components(int cameras,
                                                   const std::vector<PairPose>& pairs) {
  std::vector<int> group(cameras);
  std::iota(group.begin(), group.end(), 0);
  for (const PairPose& pair : pairs) {
    if (pair.inliers < kMinInliers || group[pair.a] == group[pair.b]) continue;
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

namespace {

/// One board in one camera.
struct BoardView {
  int camera = 0;
  const BoardObservation* observation = nullptr;
};

class BoardInitializer {
 public:
  BoardInitializer(const BoardInitialization& input, std::vector<CameraModel> cameras)
      : input_(input), result_{{input.board, std::move(cameras), {}, {}}, {}, {}} {}

  InitialBoards initialize(int max_instants) {
    for (const int64_t instant : select_instants(max_instants)) {
      const std::vector<BoardView> views = views_at(instant);
      const auto pose = best_pose(views, instant);
      if (!pose) continue;
      for (const BoardView& s : views) add(s, *pose, instant);
      result_.bundle.world_from_board.push_back(*pose);
      result_.instants.push_back(instant);
    }
    return std::move(result_);
  }

 private:
  int count() const { return static_cast<int>(input_.observations.size()); }

  std::vector<int64_t> select_instants(int max_instants) const {
    std::map<int64_t, std::vector<int>> cameras_by_instant;
    for (int i = 0; i < count(); ++i) {
      for (const auto& [instant, poses] : input_.poses[i]) cameras_by_instant[instant].push_back(i);
    }
    std::map<std::pair<int, int>, int> shared;
    for (const PairPose& pair : input_.pairs) shared[{pair.a, pair.b}] = pair.shared;
    std::vector<std::pair<double, int64_t>> scores;
    for (const auto& [instant, cameras] : cameras_by_instant) {
      double sum = 0;
      for (size_t i = 0; i < cameras.size(); ++i) {
        for (size_t j = 0; j < i; ++j) sum += 1.0 / shared[{cameras[j], cameras[i]}];
      }
      if (cameras.size() > 1) scores.emplace_back(-sum, instant);
    }
    std::sort(scores.begin(), scores.end());
    if (std::ssize(scores) > max_instants) scores.resize(max_instants);
    std::vector<int64_t> instants;
    for (const auto& [score, instant] : scores) instants.push_back(instant);
    std::sort(instants.begin(), instants.end());
    return instants;
  }

  std::vector<BoardView> views_at(int64_t instant) const {
    std::vector<BoardView> views;
    for (int i = 0; i < count(); ++i) {
      const auto found = input_.observations[i].observations.find(instant);
      if (found != input_.observations[i].observations.end()) views.push_back({i, &found->second});
    }
    return views;
  }

  std::optional<RigidTransform> best_pose(const std::vector<BoardView>& views,
                                          int64_t instant) const {
    std::optional<RigidTransform> best;
    double smallest = 1e300;
    for (const BoardView& s : views) {
      const auto found = input_.poses[s.camera].find(instant);
      if (found == input_.poses[s.camera].end()) continue;
      const RigidTransform world_from_cam =
          result_.bundle.cameras[s.camera].cam_from_world().inverse();
      for (const RigidTransform& pose : found->second) {
        const RigidTransform world_from_board = world_from_cam * pose;
        const double cost = bounded_error(views, world_from_board);
        if (cost < smallest) {
          smallest = cost;
          best = world_from_board;
        }
      }
    }
    return best;
  }

  /// The sum of bounded RMS errors. The bound limits the influence of one wrong observation.
  double bounded_error(const std::vector<BoardView>& views,
                       const RigidTransform& world_from_board) const {
    double sum = 0;
    for (const BoardView& s : views) {
      double rms = rms_at(s.camera, *s.observation, world_from_board);
      if (input_.board.has_half_turn_symmetry()) {
        rms = std::min(
            rms, rms_at(s.camera, half_turned(input_.board, *s.observation), world_from_board));
      }
      sum += std::min(200.0, rms);
    }
    return sum;
  }

  /// RMS error of about six corners, which is enough to distinguish candidates.
  double rms_at(int camera, const BoardObservation& observation,
                const RigidTransform& world_from_board) const {
    const CameraModel& model = result_.bundle.cameras[camera];
    const int step = std::max(1, observation.count() / 6);
    double squares = 0;
    int n = 0;
    for (int i = 0; i < observation.count(); i += step, ++n) {
      const auto pixel =
          model.project(world_from_board * input_.board.corner(observation.corners[i]));
      squares += pixel ? (*pixel - observation.pixels[i]).squaredNorm() : 1e12;
    }
    return std::sqrt(squares / n);
  }

  /// Adds an observation, turned where needed: which end of a board comes first is arbitrary in
  /// each image.
  void add(const BoardView& s, const RigidTransform& world_from_board, int64_t instant) {
    if (input_.board.has_half_turn_symmetry()) {
      const BoardObservation other = half_turned(input_.board, *s.observation);
      if (rms_at(s.camera, other, world_from_board) <
          rms_at(s.camera, *s.observation, world_from_board)) {
        result_.turned.insert({s.camera, instant});
        return add_points(s.camera, other);
      }
    }
    add_points(s.camera, *s.observation);
  }

  void add_points(int camera, const BoardObservation& observation) {
    for (int k = 0; k < observation.count(); ++k) {
      result_.bundle.observations.push_back(
          {camera, static_cast<int>(result_.bundle.world_from_board.size()), observation.corners[k],
           observation.pixels[k]});
    }
  }

  const BoardInitialization& input_;
  InitialBoards result_;
};

}  // namespace

InitialBoards initialize_boards(const BoardInitialization& input, std::vector<CameraModel> cameras,
                                int max_instants) {
  return BoardInitializer(input, std::move(cameras)).initialize(max_instants);
}

}  // namespace v3d::calib
