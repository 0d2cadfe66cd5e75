#include <algorithm>
#include <cstdio>

#include "base/core/error.h"
#include "base/core/statistics.h"
#include "common/console.h"
#include "common/ply_reader.h"
#include "recon/mesh/self_intersection.h"
#include "take/take.h"
#include "v3dctl/evaluate/evaluate.h"
#include "v3dctl/process.h"

namespace v3d::ctl {
namespace {

namespace fs = std::filesystem;

fs::path truth_path(const fs::path& folder, int64_t frame) {
  char name[32];
  std::snprintf(name, sizeof name, "%06lld.ply", static_cast<long long>(frame));
  return folder / name;
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

constexpr double SurfaceDistance::*kDistances[] = {
    &SurfaceDistance::accuracy_p50_mm,     &SurfaceDistance::accuracy_p90_mm,
    &SurfaceDistance::completeness_p50_mm, &SurfaceDistance::completeness_p90_mm,
    &SurfaceDistance::f_score_2mm,         &SurfaceDistance::f_score_5mm,
    &SurfaceDistance::f_score_10mm,        &SurfaceDistance::covered_2mm,
    &SurfaceDistance::covered_5mm,         &SurfaceDistance::covered_10mm,
    &SurfaceDistance::normal_error_deg};
constexpr double VisibilityFigures::*kVisibilityValues[] = {
    &VisibilityFigures::truth, &VisibilityFigures::truth_within, &VisibilityFigures::reconstructed,
    &VisibilityFigures::reconstructed_within};
constexpr double SurfaceChange::*kChanges[] = {
    &SurfaceChange::still,  &SurfaceChange::flicker_p50_mm, &SurfaceChange::flicker_p90_mm,
    &SurfaceChange::moving, &SurfaceChange::moving_p50_mm,  &SurfaceChange::moving_p90_mm};

VisibilityReport mean_of(const std::vector<VisibilityReport>& frames) {
  VisibilityReport mean;
  for (const VisibilityReport& frame : frames) {
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
    distances_.push_back(compare_surfaces(current.mesh, current.truth));
    intersections_.push_back(static_cast<double>(self_intersections(current.mesh).size()));
    visibilities_.push_back(
        compare_by_visibility(current.mesh, current.truth, current.cameras, kVisibilityLimitM));
    if (previous_ && previous_->frame + 1 == current.frame) {
      changes_.push_back(
          compare_in_time({&previous_->mesh, &previous_->truth}, {&current.mesh, &current.truth}));
    }
    previous_ = std::move(current);
  }
  TruthReport result() const {
    TruthReport report;
    report.frames = std::ssize(distances_);
    report.distance = medians(distances_, kDistances);
    report.min_covered_10mm = 1;
    for (const SurfaceDistance& frame : distances_) {
      report.min_covered_10mm = std::min(report.min_covered_10mm, frame.covered_10mm);
    }
    report.self_intersections = median(intersections_);
    report.visibility = mean_of(visibilities_);
    report.consecutive = std::ssize(changes_);
    report.change = medians(changes_, kChanges);
    return report;
  }

 private:
  std::optional<FrameWithTruth> previous_;
  std::vector<SurfaceDistance> distances_;
  std::vector<double> intersections_;
  std::vector<VisibilityReport> visibilities_;
  std::vector<SurfaceChange> changes_;
};

std::vector<CameraModel> models_of(const Rig& rig, const std::vector<std::string>& names) {
  std::vector<CameraModel> models;
  for (const RigCamera& camera : rig) {
    if (std::ranges::find(names, camera.name) != names.end()) models.push_back(camera.model);
  }
  return models;
}

}  // namespace

MeshFrames open_meshes(const EvaluatedMeshes& evaluated) {
  return evaluated.meshes ? MeshFrames(evaluated.take, *evaluated.meshes)
                          : MeshFrames(evaluated.take);
}

std::optional<Mesh> read_truth(const fs::path& truth, int64_t frame) {
  const fs::path file = truth_path(truth, frame);
  return fs::exists(file) ? std::optional(read_ply(file)) : std::nullopt;
}

TruthReport evaluate_truth(const EvaluatedMeshes& evaluated, const fs::path& truth) {
  MeshFrames meshes = open_meshes(evaluated);
  const Rig rig = load_take_calib({evaluated.take});
  TruthMeter meter;
  int64_t without_truth = 0;
  const std::vector<int64_t> frames = meshes.frames({});
  Progress progress("compare with the truth", std::ssize(frames));
  for (const int64_t frame : frames) {
    stop_if_interrupted();
    if (auto true_surface = read_truth(truth, frame)) {
      CompactFrame made = meshes.read(frame);
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
