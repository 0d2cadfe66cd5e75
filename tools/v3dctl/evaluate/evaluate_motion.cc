#include "v3dctl/evaluate/evaluate_motion.h"

#include <fmt/core.h>

#include <algorithm>
#include <utility>

#include "base/core/error.h"
#include "common/console.h"
#include "common/ply_file.h"

namespace v3d::ctl {
namespace {

namespace fs = std::filesystem;

constexpr int64_t kReportEvery = 25;  ///< pulses

/// The groups of points in the second colour of `truth`/points (v3d-sim(1)).
enum Group : uint8_t { kOther, kSleeve, kSword };

std::optional<Mesh> read_points(const fs::path& truth, int64_t pulse) {
  const fs::path file = truth / "points" / fmt::format("{:06}.ply", pulse);
  return fs::exists(file) ? std::optional(read_ply(file)) : std::nullopt;
}

/// The pulses of a motion file that follow each other and have true points.
class MotionEvaluation {
 public:
  MotionEvaluation(const EvaluatedMeshes& evaluated, const fs::path& truth)
      : truth_(truth), motion_(open_meshes(evaluated)), meshes_({evaluated.take}) {
    for (const int64_t pulse : motion_.frames({})) {
      if (!pulses_.empty() && pulse != pulses_.back() + 1) break;
      if (!read_points(truth, pulse)) break;
      pulses_.push_back(pulse);
    }
  }

  std::optional<MotionReport> run() {
    if (pulses_.size() < 2) return std::nullopt;
    find_seen();
    Mesh surface = motion_.read(pulses_[0]).mesh;
    const std::vector<Eigen::Vector3f> start = read_points(truth_, pulses_[0])->vertices;
    recon::CarriedPoints carried(surface, start);
    recon::CarriedPoints dropped(meshes_.read(pulses_[0]).mesh, start);
    report_.first_pulse = pulses_[0];
    report_.segments = 1;
    report_.bound = bound_share(carried);
    Progress progress("carry points", std::ssize(pulses_));
    for (size_t i = 1; i < pulses_.size(); ++i) {
      stop_if_interrupted();
      Mesh next = motion_.read(pulses_[i]).mesh;
      if (next.triangles == surface.triangles) {
        carried.follow(next);
      } else {
        carried.rebind(next);
        ++report_.segments;
      }
      surface = std::move(next);
      dropped.move_to_nearest(meshes_.read(pulses_[i]).mesh);
      const auto since = static_cast<int64_t>(i);
      if (since % kReportEvery == 0 || i + 1 == pulses_.size()) add(since, carried, dropped);
      progress.advance();
    }
    report_.mean_segment_pulses =
        static_cast<double>(pulses_.size()) / static_cast<double>(report_.segments);
    return report_;
  }

 private:
  void find_seen() {
    const Mesh first = *read_points(truth_, pulses_[0]);
    seen_.assign(first.vertices.size(), 0);
    groups_.resize(first.vertices.size());
    for (size_t i = 0; i < groups_.size(); ++i) groups_[i] = first.colours[i].g;
    for (const int64_t pulse : pulses_) {
      const Mesh points = *read_points(truth_, pulse);
      if (points.vertices.size() != seen_.size()) {
        throw InputError((truth_ / "points").string() + ": pulse " + std::to_string(pulse) +
                         " has another number of points than the first one");
      }
      for (size_t i = 0; i < seen_.size(); ++i) seen_[i] |= points.colours[i].r > 0 ? 1 : 0;
    }
  }

  double bound_share(const recon::CarriedPoints& carried) const {
    double seen = 0, bound = 0;
    for (size_t i = 0; i < seen_.size(); ++i) {
      seen += seen_[i];
      bound += seen_[i] != 0 && carried.is_bound(i) ? 1 : 0;
    }
    return seen > 0 ? bound / seen : 0;
  }

  std::vector<uint8_t> seen_in(uint8_t group) const {
    std::vector<uint8_t> chosen = seen_;
    for (size_t i = 0; i < chosen.size(); ++i) chosen[i] &= groups_[i] == group ? 1 : 0;
    return chosen;
  }

  void add(int64_t since, const recon::CarriedPoints& carried,
           const recon::CarriedPoints& dropped) {
    const int64_t pulse = pulses_[static_cast<size_t>(since)];
    const std::vector<Eigen::Vector3f> places = read_points(truth_, pulse)->vertices;
    const auto true_surface = read_truth(truth_, pulse);
    const std::vector<Eigen::Vector3f> normals =
        recon::normals_at(true_surface ? *true_surface : Mesh(), places);
    report_.carried.push_back({since, recon::end_point_error(carried, places, normals, seen_),
                               recon::end_point_error(carried, places, normals, seen_in(kSleeve)),
                               recon::end_point_error(carried, places, normals, seen_in(kSword)),
                               recon::end_point_error(dropped, places, normals, seen_)});
  }

  const fs::path truth_;
  recorded::MeshFrames motion_, meshes_;
  std::vector<int64_t> pulses_;
  std::vector<uint8_t> seen_, groups_;  ///< of each point
  MotionReport report_;
};

}  // namespace

std::optional<MotionReport> evaluate_motion(const EvaluatedMeshes& evaluated,
                                            const fs::path& truth) {
  if (!evaluated.meshes || !recorded::is_motion_file(*evaluated.meshes)) return std::nullopt;
  return MotionEvaluation(evaluated, truth).run();
}

}  // namespace v3d::ctl
