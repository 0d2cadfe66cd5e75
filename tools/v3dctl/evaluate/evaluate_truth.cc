#include <fmt/core.h>

#include <algorithm>
#include <iterator>
#include <utility>

#include "base/core/error.h"
#include "base/core/statistics.h"
#include "base/io/file.h"
#include "common/console.h"
#include "common/mesh_formats.h"
#include "recon/mesh/self_intersection.h"
#include "take/take.h"
#include "v3dctl/evaluate/evaluate.h"
#include "v3dctl/motion/tracked_surfaces.h"

namespace v3d::ctl {
namespace {

namespace fs = std::filesystem;

/// Median of each value.
template <class Figures, size_t kCount>
Figures medians(const std::vector<Figures>& frames, double Figures::*const (&figures)[kCount]) {
  Figures result;
  for (const auto figure : figures) {
    std::vector<double> values;
    for (const Figures& frame : frames) values.push_back(frame.*figure);
    result.*figure = median(values);
  }
  return result;
}

constexpr double recon::SurfaceDistance::*kDistances[] = {
    &recon::SurfaceDistance::accuracy_p50_mm,
    &recon::SurfaceDistance::accuracy_p90_mm,
    &recon::SurfaceDistance::completeness_p50_mm,
    &recon::SurfaceDistance::completeness_p90_mm,
    &recon::SurfaceDistance::f_score_2mm,
    &recon::SurfaceDistance::f_score_5mm,
    &recon::SurfaceDistance::f_score_10mm,
    &recon::SurfaceDistance::covered_2mm,
    &recon::SurfaceDistance::covered_5mm,
    &recon::SurfaceDistance::covered_10mm,
    &recon::SurfaceDistance::covered_10mm_by_largest,
    &recon::SurfaceDistance::normal_error_deg};
constexpr double recon::SurfaceChange::*kParts[] = {&recon::SurfaceChange::still,
                                                    &recon::SurfaceChange::moving};
constexpr double recon::SurfaceChange::*kFlicker[] = {&recon::SurfaceChange::flicker_p50_mm,
                                                      &recon::SurfaceChange::flicker_p90_mm};
constexpr double recon::SurfaceChange::*kMotion[] = {&recon::SurfaceChange::moving_p50_mm,
                                                     &recon::SurfaceChange::moving_p90_mm};

/// The changes that have this part of the surface: others have no distances there.
std::vector<recon::SurfaceChange> changes_with(double recon::SurfaceChange::*part,
                                               const std::vector<recon::SurfaceChange>& changes) {
  std::vector<recon::SurfaceChange> some;
  std::ranges::copy_if(changes, std::back_inserter(some),
                       [&](const recon::SurfaceChange& change) { return change.*part > 0; });
  return some;
}

void put_changes(const std::vector<recon::SurfaceChange>& changes, TruthReport& report) {
  const auto still = changes_with(&recon::SurfaceChange::still, changes);
  const auto moving = changes_with(&recon::SurfaceChange::moving, changes);
  report.consecutive = std::ssize(changes);
  report.still_frames = std::ssize(still);
  report.moving_frames = std::ssize(moving);
  report.change = medians(changes, kParts);
  const recon::SurfaceChange flicker = medians(still, kFlicker), motion = medians(moving, kMotion);
  for (const auto figure : kFlicker) report.change.*figure = flicker.*figure;
  for (const auto figure : kMotion) report.change.*figure = motion.*figure;
}

/// Mean of a figure over the frames where the surface that `part` divides has an area.
double mean_of(const std::vector<recon::VisibilityReport>& frames, size_t n,
               double recon::VisibilityFigures::*figure, double recon::VisibilityFigures::*part) {
  std::vector<double> values;
  for (const recon::VisibilityReport& frame : frames) {
    const bool has_area = std::ranges::any_of(
        frame.seen_by, [&](const recon::VisibilityFigures& f) { return f.*part > 0; });
    if (has_area) values.push_back(frame.seen_by[n].*figure);
  }
  return mean(values);
}

recon::VisibilityReport mean_of(const std::vector<recon::VisibilityReport>& frames) {
  using Figures = recon::VisibilityFigures;
  recon::VisibilityReport means;
  for (size_t n = 0; n < means.seen_by.size(); ++n) {
    for (const auto figure : {&Figures::truth, &Figures::truth_within}) {
      means.seen_by[n].*figure = mean_of(frames, n, figure, &Figures::truth);
    }
    for (const auto figure : {&Figures::reconstructed, &Figures::reconstructed_within}) {
      means.seen_by[n].*figure = mean_of(frames, n, figure, &Figures::reconstructed);
    }
  }
  return means;
}

/// A mesh, the true surface of its frame and the used cameras.
struct FrameWithTruth {
  int64_t frame = 0;
  Mesh mesh, truth;
  std::vector<CameraModel> cameras;
};

/// Measures frames in increasing order.
class TruthMeter {
 public:
  void add(FrameWithTruth current) {
    distances_.push_back(recon::compare_surfaces(current.mesh, current.truth));
    intersections_.push_back(static_cast<double>(recon::self_intersections(current.mesh).size()));
    visibilities_.push_back(recon::compare_by_visibility(current.mesh, current.truth,
                                                         current.cameras, kVisibilityLimitM));
    if (previous_ && previous_->frame + 1 == current.frame) {
      const auto change = recon::compare_in_time({&previous_->mesh, &previous_->truth},
                                                 {&current.mesh, &current.truth});
      if (change) changes_.push_back(*change);
    }
    previous_ = std::move(current);
  }
  TruthReport result() const {
    TruthReport report;
    report.frames = std::ssize(distances_);
    report.distance = medians(distances_, kDistances);
    report.min_covered_10mm = 1;
    for (const recon::SurfaceDistance& frame : distances_) {
      report.min_covered_10mm = std::min(report.min_covered_10mm, frame.covered_10mm);
      report.mean_covered_10mm += frame.covered_10mm / static_cast<double>(distances_.size());
      const double apart = frame.covered_10mm - frame.covered_10mm_by_largest;
      report.joined_frames += apart <= kMaxApart ? 1 : 0;
    }
    report.self_intersections = median(intersections_);
    report.visibility = mean_of(visibilities_);
    put_changes(changes_, report);
    return report;
  }

 private:
  std::optional<FrameWithTruth> previous_;
  std::vector<recon::SurfaceDistance> distances_;
  std::vector<double> intersections_;
  std::vector<recon::VisibilityReport> visibilities_;
  std::vector<recon::SurfaceChange> changes_;
};

std::vector<CameraModel> models_of(const Rig& rig, const std::vector<std::string>& names) {
  std::vector<CameraModel> models;
  for (const RigCamera& camera : rig) {
    if (std::ranges::find(names, camera.name) != names.end()) models.push_back(camera.model);
  }
  return models;
}

}  // namespace

fs::path truth_path(const fs::path& truth, int64_t frame) {
  return truth / fmt::format("{:06}.ply", frame);
}

recorded::MeshFrames open_meshes(const EvaluatedMeshes& evaluated) {
  return evaluated.meshes ? recorded::MeshFrames(evaluated.take, *evaluated.meshes)
                          : recorded::MeshFrames(evaluated.take);
}

std::optional<Mesh> read_truth(const fs::path& truth, int64_t frame) {
  const fs::path file = truth_path(truth, frame);
  return fs::exists(file) ? std::optional(read_ply(file)) : std::nullopt;
}

TruthReport evaluate_truth(const EvaluatedMeshes& evaluated, const fs::path& truth) {
  recorded::MeshFrames meshes = open_meshes(evaluated);
  const Rig rig = take::load_take_calib({evaluated.take});
  TruthMeter meter;
  int64_t without_truth = 0;
  const std::vector<int64_t> frames = meshes.frames({});
  Progress progress("compare with the truth", std::ssize(frames));
  for (const int64_t frame : frames) {
    stop_if_interrupted();
    if (auto true_surface = read_truth(truth, frame)) {
      recon::CompactFrame made = meshes.read(frame);
      meter.add(
          {frame, std::move(made.mesh), *std::move(true_surface), models_of(rig, made.cameras)});
    } else {
      ++without_truth;
    }
    progress.advance();
  }
  if (without_truth == std::ssize(frames)) {
    throw InputError(
        truth_path(truth, frames.front()).string() +
        ": does not exist, nor the truth of any other frame; expected DIR/000012.ply for frame 12");
  }
  TruthReport report = meter.result();
  report.without_truth = without_truth;
  return report;
}

namespace {

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
