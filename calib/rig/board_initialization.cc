#include "calib/rig/board_initialization.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <optional>
#include <utility>

namespace v3d::calib {
namespace {

/// One board in one camera.
struct BoardView {
  int camera = 0;
  const BoardObservation* observation = nullptr;
};

class BoardInitializer {
 public:
  BoardInitializer(const BoardInitialization& input, std::vector<CameraModel> cameras)
      : input_(input), result_{{input.board, std::move(cameras), {}, {}}, {}} {}

  InitialBoards initialize(int max_instants) {
    for (const int64_t instant : select_instants(max_instants)) {
      const std::vector<BoardView> views = views_at(instant);
      const auto pose = best_pose(views, instant);
      if (!pose) continue;
      for (const BoardView& s : views) add(s, *pose);
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
  void add(const BoardView& s, const RigidTransform& world_from_board) {
    if (input_.board.has_half_turn_symmetry()) {
      const BoardObservation other = half_turned(input_.board, *s.observation);
      if (rms_at(s.camera, other, world_from_board) <
          rms_at(s.camera, *s.observation, world_from_board)) {
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
