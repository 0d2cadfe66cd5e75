#include "calib/rig/board_initialization.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <optional>
#include <utility>

namespace v3d::calib {
namespace {

/// One board in one camera.
struct Observation {
  int camera = 0;
  const BoardObservation* seen = nullptr;
};

class Placer {
 public:
  Placer(const BoardPlaces& from, std::vector<CameraModel> cameras)
      : from_(from), placed_{{from.board, std::move(cameras), {}, {}}, {}} {}

  PlacedBoards place(int most) {
    for (const int64_t instant : chosen_instants(most)) {
      const std::vector<Observation> observations = observations_at(instant);
      const auto pose = best_pose(observations, instant);
      if (!pose) continue;
      for (const Observation& s : observations) add(s, *pose);
      placed_.bundle.world_from_board.push_back(*pose);
      placed_.instants.push_back(instant);
    }
    return std::move(placed_);
  }

 private:
  int count() const { return static_cast<int>(from_.seen.size()); }

  std::vector<int64_t> chosen_instants(int most) const {
    std::map<int64_t, std::vector<int>> who;
    for (int i = 0; i < count(); ++i) {
      for (const auto& [instant, poses] : from_.poses[i]) who[instant].push_back(i);
    }
    std::map<std::pair<int, int>, int> shared;
    for (const PairPose& pair : from_.pairs) shared[{pair.a, pair.b}] = pair.shared;
    std::vector<std::pair<double, int64_t>> worth;
    for (const auto& [instant, cameras] : who) {
      double sum = 0;
      for (size_t i = 0; i < cameras.size(); ++i) {
        for (size_t j = 0; j < i; ++j) sum += 1.0 / shared[{cameras[j], cameras[i]}];
      }
      if (cameras.size() > 1) worth.emplace_back(-sum, instant);
    }
    std::sort(worth.begin(), worth.end());
    if (std::ssize(worth) > most) worth.resize(most);
    std::vector<int64_t> instants;
    for (const auto& [w, instant] : worth) instants.push_back(instant);
    std::sort(instants.begin(), instants.end());
    return instants;
  }

  std::vector<Observation> observations_at(int64_t instant) const {
    std::vector<Observation> observations;
    for (int i = 0; i < count(); ++i) {
      const auto found = from_.seen[i].observations.find(instant);
      if (found != from_.seen[i].observations.end()) observations.push_back({i, &found->second});
    }
    return observations;
  }

  std::optional<RigidTransform> best_pose(const std::vector<Observation>& observations,
                                          int64_t instant) const {
    std::optional<RigidTransform> best;
    double least = 1e300;
    for (const Observation& s : observations) {
      const auto found = from_.poses[s.camera].find(instant);
      if (found == from_.poses[s.camera].end()) continue;
      const RigidTransform world_from_cam =
          placed_.bundle.cameras[s.camera].cam_from_world().inverse();
      for (const RigidTransform& pose : found->second) {
        const RigidTransform world_from_board = world_from_cam * pose;
        const double cost = disagreement(observations, world_from_board);
        if (cost < least) {
          least = cost;
          best = world_from_board;
        }
      }
    }
    return best;
  }

  /// Bounded, so that one misread picture does not decide.
  double disagreement(const std::vector<Observation>& observations,
                      const RigidTransform& world_from_board) const {
    double sum = 0;
    for (const Observation& s : observations) {
      double rms = rms_at(s.camera, *s.seen, world_from_board);
      if (from_.board.has_half_turn_symmetry()) {
        rms = std::min(rms, rms_at(s.camera, half_turned(from_.board, *s.seen), world_from_board));
      }
      sum += std::min(200.0, rms);
    }
    return sum;
  }

  /// A few corners tell.
  double rms_at(int camera, const BoardObservation& seen,
                const RigidTransform& world_from_board) const {
    const CameraModel& model = placed_.bundle.cameras[camera];
    const int step = std::max(1, seen.count() / 6);
    double squares = 0;
    int n = 0;
    for (int i = 0; i < seen.count(); i += step, ++n) {
      const auto pixel = model.project(world_from_board * from_.board.corner(seen.corners[i]));
      squares += pixel ? (*pixel - seen.pixels[i]).squaredNorm() : 1e12;
    }
    return std::sqrt(squares / n);
  }

  /// Which end came first is arbitrary per picture: from here on all pictures say the same.
  void add(const Observation& s, const RigidTransform& world_from_board) {
    if (from_.board.has_half_turn_symmetry()) {
      const BoardObservation other = half_turned(from_.board, *s.seen);
      if (rms_at(s.camera, other, world_from_board) < rms_at(s.camera, *s.seen, world_from_board)) {
        return add_points(s.camera, other);
      }
    }
    add_points(s.camera, *s.seen);
  }

  void add_points(int camera, const BoardObservation& seen) {
    for (int k = 0; k < seen.count(); ++k) {
      placed_.bundle.observations.push_back(
          {camera, static_cast<int>(placed_.bundle.world_from_board.size()), seen.corners[k],
           seen.pixels[k]});
    }
  }

  const BoardPlaces& from_;
  PlacedBoards placed_;
};

}  // namespace

PlacedBoards place_boards(const BoardPlaces& from, std::vector<CameraModel> cameras, int most) {
  return Placer(from, std::move(cameras)).place(most);
}

}  // namespace v3d::calib
