#include "v3dctl/evaluate/evaluate_motion.h"

#include <fmt/core.h>

#include <algorithm>
#include <utility>

#include "base/core/error.h"
#include "base/io/file.h"
#include "common/console.h"
#include "common/ply_file.h"
#include "v3dctl/motion/tracked_surfaces.h"

namespace v3d::ctl {
namespace {

namespace fs = std::filesystem;

constexpr int64_t kReportEvery = 25;  ///< pulses

/// The groups of points in the second colour of `truth`/points (v3d-sim(1)).
enum Group : uint8_t { kOther, kSleeve, kSword };

/// The points at a pulse, each with a colour; empty without the file.
std::optional<Mesh> read_points(const fs::path& truth, int64_t pulse) {
  const fs::path file = truth / "points" / fmt::format("{:06}.ply", pulse);
  if (!fs::exists(file)) return std::nullopt;
  Mesh points = read_ply(file);
  if (points.colours.size() != points.vertices.size()) {
    throw InputError(file.string() +
                     ": has no colours; expected red, green and blue, as v3d-sim take --truth "
                     "writes");
  }
  return points;
}

/// The pulses of a motion file that follow each other and have true points.
class MotionEvaluation {
 public:
  MotionEvaluation(const EvaluatedMeshes& evaluated, const fs::path& truth)
      : truth_(truth), motion_(*evaluated.meshes), meshes_({evaluated.take}) {
    for (const TrackedSurfaces::Place& place : motion_.places()) {
      const int64_t after = places_.empty() ? 0 : place.pulse - places_.back().pulse;
      if (after > 1 || !read_points(truth, place.pulse)) break;
      places_.push_back(place);
    }
  }

  std::optional<MotionReport> run() {
    if (places_.size() < 2) return std::nullopt;
    find_seen();
    const std::vector<Eigen::Vector3f> start = read_points(truth_, first())->vertices;
    recon::CarriedPoints carried(motion_.read(places_[0]), start);
    recon::CarriedPoints dropped(meshes_.read(first()).mesh, start);
    report_.first_pulse = first();
    report_.segments = 1;
    report_.bound = bound_share(carried);
    Progress progress("carry points", std::ssize(places_));
    for (size_t i = 1; i < places_.size(); ++i) {
      stop_if_interrupted();
      carry(carried, places_[i - 1], places_[i]);
      progress.advance();
      const int64_t pulse = places_[i].pulse;
      const bool is_shown_again = i + 1 < places_.size() && places_[i + 1].pulse == pulse;
      if (is_shown_again) continue;
      dropped.move_to_nearest(meshes_.read(pulse).mesh);
      const int64_t since = pulse - first();
      if (since % kReportEvery == 0 || i + 1 == places_.size()) add(pulse, carried, dropped);
    }
    report_.mean_segment_pulses = static_cast<double>(places_.back().pulse - first() + 1) /
                                  static_cast<double>(report_.segments);
    return report_;
  }

 private:
  int64_t first() const { return places_[0].pulse; }

  void carry(recon::CarriedPoints& points, const TrackedSurfaces::Place& from,
             const TrackedSurfaces::Place& to) {
    const Mesh surface = motion_.read(to);
    if (to.segment == from.segment) {
      points.follow(surface);
      return;
    }
    ++report_.segments;
    if (to.pulse == from.pulse) {
      points.change_surface(surface);
    } else {
      points.change_surface_later(surface);
    }
  }

  void find_seen() {
    const Mesh start = *read_points(truth_, first());
    seen_.assign(start.vertices.size(), 0);
    groups_.resize(start.vertices.size());
    for (size_t i = 0; i < groups_.size(); ++i) groups_[i] = start.colours[i].g;
    for (const TrackedSurfaces::Place& place : places_) {
      const Mesh points = *read_points(truth_, place.pulse);
      if (points.vertices.size() != seen_.size()) {
        throw InputError((truth_ / "points").string() + ": pulse " + std::to_string(place.pulse) +
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

  void add(int64_t pulse, const recon::CarriedPoints& carried,
           const recon::CarriedPoints& dropped) {
    const std::vector<Eigen::Vector3f> positions = read_points(truth_, pulse)->vertices;
    const auto true_surface = read_truth(truth_, pulse);
    const std::vector<Eigen::Vector3f> normals =
        recon::normals_at(true_surface ? *true_surface : Mesh(), positions);
    report_.carried.push_back(
        {pulse - first(), recon::end_point_error(carried, positions, normals, seen_),
         recon::end_point_error(carried, positions, normals, seen_in(kSleeve)),
         recon::end_point_error(carried, positions, normals, seen_in(kSword)),
         recon::end_point_error(dropped, positions, normals, seen_)});
  }

  const fs::path truth_;
  TrackedSurfaces motion_;
  recorded::MeshFrames meshes_;
  std::vector<TrackedSurfaces::Place> places_;
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
