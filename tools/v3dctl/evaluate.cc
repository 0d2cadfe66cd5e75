#include "v3dctl/evaluate.h"

#include <algorithm>
#include <cstdio>

#include "base/demosaic.h"
#include "base/error.h"
#include "common/console.h"
#include "common/ply_reader.h"
#include "daemon/recorded/take_frames.h"
#include "daemon/recorded/view_colours.h"
#include "recon/renderer.h"
#include "recon/self_intersection.h"
#include "recon/silhouette.h"
#include "v3dctl/interrupt.h"
#include "v3dctl/statistics.h"

namespace v3d::ctl {
namespace {

namespace fs = std::filesystem;

fs::path truth_of(const fs::path& folder, int64_t frame) {
  char name[32];
  std::snprintf(name, sizeof name, "%06lld.ply", static_cast<long long>(frame));
  return folder / name;
}

/// Figure by figure.
template <class Figures, size_t kCount>
Figures medians(const std::vector<Figures>& frames, double Figures::*const (&figures)[kCount]) {
  Figures middle;
  for (const auto figure : figures) {
    std::vector<double> values;
    for (const Figures& frame : frames) values.push_back(frame.*figure);
    middle.*figure = median(values);
  }
  return middle;
}

constexpr double SurfaceDistance::*kDistances[] = {
    &SurfaceDistance::accuracy_p50_mm,     &SurfaceDistance::accuracy_p90_mm,
    &SurfaceDistance::completeness_p50_mm, &SurfaceDistance::completeness_p90_mm,
    &SurfaceDistance::f_score_2mm,         &SurfaceDistance::f_score_5mm,
    &SurfaceDistance::f_score_10mm,        &SurfaceDistance::covered_2mm,
    &SurfaceDistance::covered_5mm,         &SurfaceDistance::covered_10mm,
    &SurfaceDistance::normal_error_deg};
constexpr double SurfaceChange::*kChanges[] = {
    &SurfaceChange::still,  &SurfaceChange::flicker_p50_mm, &SurfaceChange::flicker_p90_mm,
    &SurfaceChange::moving, &SurfaceChange::moving_p50_mm,  &SurfaceChange::moving_p90_mm};

/// A frame and its true surface.
struct KnownFrame {
  int64_t frame = 0;
  Mesh mesh, truth;
};

/// Figures of frames that come one after the other.
class TruthMeter {
 public:
  void add(KnownFrame now) {
    distances_.push_back(compare_surfaces(now.mesh, now.truth));
    crossings_.push_back(static_cast<double>(self_intersections(now.mesh).size()));
    if (before_ && before_->frame + 1 == now.frame) {
      changes_.push_back(
          compare_in_time({&before_->mesh, &before_->truth}, {&now.mesh, &now.truth}));
    }
    before_ = std::move(now);
  }
  TruthReport result() const {
    TruthReport report;
    report.frames = std::ssize(distances_);
    report.distance = medians(distances_, kDistances);
    report.least_covered_10mm = 1;
    for (const SurfaceDistance& frame : distances_) {
      report.least_covered_10mm = std::min(report.least_covered_10mm, frame.covered_10mm);
    }
    report.self_intersections = median(crossings_);
    report.in_a_row = std::ssize(changes_);
    report.change = medians(changes_, kChanges);
    return report;
  }

 private:
  std::optional<KnownFrame> before_;
  std::vector<SurfaceDistance> distances_;
  std::vector<double> crossings_;
  std::vector<SurfaceChange> changes_;
};

void require_held_out(const CompactFrame& frame, const std::vector<std::string>& cameras) {
  for (const std::string& camera : cameras) {
    if (std::find(frame.cameras.begin(), frame.cameras.end(), camera) == frame.cameras.end())
      continue;
    throw InputError("--held-out " + camera + ": took part in frame " +
                     std::to_string(frame.pulse) + ": reconstruct with --leave-out " + camera +
                     " first");
  }
}

struct Samples {
  std::vector<double> psnr, similarity, iou;
};

void compare_with_photograph(const Mesh& mesh, const RigCamera& camera, const SegmentedFrame& frame,
                             Samples& samples) {
  const Image drawn = draw_mesh(mesh, camera.model);
  Image photograph = to_rgb(frame.raw.image.view());
  correct(photograph, camera.colour);
  samples.psnr.push_back(psnr_db(drawn.view(), photograph.view(), frame.mask));
  samples.similarity.push_back(ssim(drawn.view(), photograph.view(), frame.mask));
  samples.iou.push_back(intersection_over_union(draw_silhouette(mesh, camera.model), frame.mask));
}

}  // namespace

MeshFrames frames_of(const Evaluated& evaluated) {
  return evaluated.meshes ? MeshFrames(evaluated.take, *evaluated.meshes)
                          : MeshFrames(evaluated.take);
}

std::optional<Mesh> read_truth(const fs::path& truth, int64_t frame) {
  const fs::path file = truth_of(truth, frame);
  return fs::exists(file) ? std::optional(read_ply(file)) : std::nullopt;
}

TruthReport evaluate_truth(const Evaluated& evaluated, const fs::path& truth) {
  MeshFrames meshes = frames_of(evaluated);
  TruthMeter meter;
  int64_t without_truth = 0;
  const std::vector<int64_t> frames = meshes.frames({});
  Progress progress("compare with the truth", std::ssize(frames));
  for (const int64_t frame : frames) {
    stop_if_interrupted();
    if (auto known = read_truth(truth, frame)) {
      meter.add({frame, meshes.read(frame).mesh, *std::move(known)});
    } else {
      ++without_truth;
    }
    progress.advance();
  }
  if (without_truth == std::ssize(frames)) {
    throw InputError(
        truth_of(truth, frames.front()).string() +
        ": is not there, nor the truth of any other frame; want DIR/000012.ply for frame 12");
  }
  TruthReport report = meter.result();
  report.without_truth = without_truth;
  return report;
}

std::vector<HeldOutReport> evaluate_held_out(const Evaluated& evaluated,
                                             const std::vector<std::string>& cameras,
                                             bool view_dependent) {
  MeshFrames meshes = frames_of(evaluated);
  TakeFrames recorded(evaluated.take, cameras);
  std::vector<Samples> samples(cameras.size());
  const std::vector<int64_t> frames = meshes.frames({});
  Progress progress("compare with the cameras", std::ssize(frames));
  for (const int64_t frame : frames) {
    stop_if_interrupted();
    const CompactFrame compact = meshes.read(frame);
    require_held_out(compact, cameras);
    const auto views = recorded.read(frame);
    std::optional<ViewColours> colours;
    if (view_dependent) colours.emplace(evaluated.take, compact);
    for (size_t i = 0; i < cameras.size(); ++i) {
      if (!views[i] || views[i]->mask.count() == 0) continue;
      const RigCamera& eye = recorded.rig()[i];
      compare_with_photograph(colours ? colours->seen_by(eye.model, compact.mesh) : compact.mesh,
                              eye, *views[i], samples[i]);
    }
    progress.advance();
  }
  std::vector<HeldOutReport> reports;
  for (size_t i = 0; i < cameras.size(); ++i) {
    const Samples& s = samples[i];
    reports.push_back(
        {cameras[i], std::ssize(s.psnr), mean(s.psnr), mean(s.similarity), mean(s.iou)});
  }
  return reports;
}

}  // namespace v3d::ctl
