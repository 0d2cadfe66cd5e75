#include <fmt/core.h>

#include <algorithm>

#include "base/core/error.h"
#include "base/core/statistics.h"
#include "common/console.h"
#include "common/ply_file.h"
#include "recon/mesh/self_intersection.h"
#include "take/take.h"
#include "v3dctl/evaluate/evaluate.h"

namespace v3d::ctl {
namespace {

namespace fs = std::filesystem;

fs::path truth_path(const fs::path& folder, int64_t frame) {
  return folder / fmt::format("{:06}.ply", frame);
}

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
constexpr double recon::VisibilityFigures::*kVisibilityValues[] = {
    &recon::VisibilityFigures::truth, &recon::VisibilityFigures::truth_within,
    &recon::VisibilityFigures::reconstructed, &recon::VisibilityFigures::reconstructed_within};
constexpr double recon::SurfaceChange::*kChanges[] = {
    &recon::SurfaceChange::still,          &recon::SurfaceChange::flicker_p50_mm,
    &recon::SurfaceChange::flicker_p90_mm, &recon::SurfaceChange::moving,
    &recon::SurfaceChange::moving_p50_mm,  &recon::SurfaceChange::moving_p90_mm};

recon::VisibilityReport mean_of(const std::vector<recon::VisibilityReport>& frames) {
  recon::VisibilityReport mean;
  for (const recon::VisibilityReport& frame : frames) {
    for (size_t n = 0; n < mean.seen_by.size(); ++n) {
      for (const auto figure : kVisibilityValues) {
        mean.seen_by[n].*figure += frame.seen_by[n].*figure / static_cast<double>(frames.size());
      }
    }
  }
  return mean;
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
      changes_.push_back(recon::compare_in_time({&previous_->mesh, &previous_->truth},
                                                {&current.mesh, &current.truth}));
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
    report.consecutive = std::ssize(changes_);
    report.change = medians(changes_, kChanges);
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

}  // namespace v3d::ctl
