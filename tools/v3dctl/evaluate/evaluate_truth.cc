#include <algorithm>
#include <cstdio>

#include "base/error.h"
#include "base/statistics.h"
#include "common/console.h"
#include "common/ply_reader.h"
#include "daemon/recorded/frame_colours.h"
#include "daemon/recorded/take_frames.h"
#include "recon/mesh_edges.h"
#include "recon/self_intersection.h"
#include "recon/silhouette.h"
#include "v3dctl/evaluate/evaluate.h"
#include "v3dctl/evaluate/held_out_view.h"
#include "v3dctl/process.h"

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
constexpr double SightFigures::*kSightFigures[] = {
    &SightFigures::truth, &SightFigures::truth_within, &SightFigures::reconstructed,
    &SightFigures::reconstructed_within};
constexpr double SurfaceChange::*kChanges[] = {
    &SurfaceChange::still,  &SurfaceChange::flicker_p50_mm, &SurfaceChange::flicker_p90_mm,
    &SurfaceChange::moving, &SurfaceChange::moving_p50_mm,  &SurfaceChange::moving_p90_mm};

SightReport mean_of(const std::vector<SightReport>& frames) {
  SightReport mean;
  for (const SightReport& frame : frames) {
    for (size_t n = 0; n < mean.seen_by.size(); ++n) {
      for (const auto figure : kSightFigures) {
        mean.seen_by[n].*figure += frame.seen_by[n].*figure / static_cast<double>(frames.size());
      }
    }
  }
  return mean;
}

/// A frame, its true surface and the cameras that took part.
struct KnownFrame {
  int64_t frame = 0;
  Mesh mesh, truth;
  std::vector<CameraModel> cameras;
};

/// Figures of frames that come one after the other.
class TruthMeter {
 public:
  void add(KnownFrame now) {
    distances_.push_back(compare_surfaces(now.mesh, now.truth));
    crossings_.push_back(static_cast<double>(self_intersections(now.mesh).size()));
    sights_.push_back(compare_by_sight(now.mesh, now.truth, now.cameras, kSightLimitM));
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
    report.sight = mean_of(sights_);
    report.in_a_row = std::ssize(changes_);
    report.change = medians(changes_, kChanges);
    return report;
  }

 private:
  std::optional<KnownFrame> before_;
  std::vector<SurfaceDistance> distances_;
  std::vector<double> crossings_;
  std::vector<SightReport> sights_;
  std::vector<SurfaceChange> changes_;
};

std::vector<CameraModel> models_of(const Rig& rig, const std::vector<std::string>& names) {
  std::vector<CameraModel> models;
  for (const RigCamera& camera : rig) {
    if (std::ranges::find(names, camera.name) != names.end()) models.push_back(camera.model);
  }
  return models;
}

void require_held_out(const CompactFrame& frame, const std::vector<std::string>& cameras) {
  for (const std::string& camera : cameras) {
    if (std::find(frame.cameras.begin(), frame.cameras.end(), camera) == frame.cameras.end())
      continue;
    throw InputError("--held-out " + camera + ": took part in frame " +
                     std::to_string(frame.pulse) + ": reconstruct with --leave-out " + camera +
                     " first");
  }
}

PictureFigures compare_pictures(const Image& drawn, const Image& photograph, const Mask& where) {
  return {psnr_db(drawn.view(), photograph.view(), where),
          ssim(drawn.view(), photograph.view(), where)};
}

PictureFigures mean_of(const std::vector<PictureFigures>& frames) {
  PictureFigures mean;
  for (const PictureFigures& frame : frames) {
    mean.psnr_db += frame.psnr_db / static_cast<double>(frames.size());
    mean.ssim += frame.ssim / static_cast<double>(frames.size());
  }
  return mean;
}

/// Of one camera, frame by frame.
class HeldOutSamples {
 public:
  void add(const HeldOutView& view, const Mesh& mesh, const CameraModel& camera) {
    const Image drawn = view.drawn(mesh);
    inside_.push_back(compare_pictures(drawn, view.photograph(), view.inside()));
    whole_mask_.push_back(compare_pictures(drawn, view.photograph(), view.mask()));
    iou_.push_back(intersection_over_union(draw_silhouette(mesh, camera), view.mask()));
  }
  void add_truth(const HeldOutView& view, const Mesh& truth) {
    truth_.push_back(compare_pictures(view.drawn(truth), view.photograph(), view.inside()));
  }
  HeldOutReport report(const std::string& camera) const {
    HeldOutReport report{
        camera, std::ssize(iou_), mean_of(inside_), mean_of(whole_mask_), mean(iou_), {}};
    if (!truth_.empty()) report.true_surface = mean_of(truth_);
    return report;
  }

 private:
  std::vector<PictureFigures> inside_, whole_mask_, truth_;
  std::vector<double> iou_;
};

/// The true surface with vertices as near to each other as those of `mesh`, to be coloured like it.
std::optional<Mesh> truth_like(const Mesh& mesh, const fs::path& truth, int64_t frame) {
  if (truth.empty() || mesh.triangles.empty()) return {};
  const auto known = read_truth(truth, frame);
  return known ? std::optional(with_short_edges(*known, mean_edge(mesh))) : std::nullopt;
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
  const Rig rig = load_take_calib({evaluated.take});
  TruthMeter meter;
  int64_t without_truth = 0;
  const std::vector<int64_t> frames = meshes.frames({});
  Progress progress("compare with the truth", std::ssize(frames));
  for (const int64_t frame : frames) {
    stop_if_interrupted();
    if (auto known = read_truth(truth, frame)) {
      CompactFrame made = meshes.read(frame);
      meter.add({frame, std::move(made.mesh), *std::move(known), models_of(rig, made.cameras)});
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
                                             const HeldOutRequest& request) {
  MeshFrames meshes = frames_of(evaluated);
  TakeFrames recorded(evaluated.take, request.cameras);
  std::vector<HeldOutSamples> samples(request.cameras.size());
  const std::vector<int64_t> frames = meshes.frames({});
  Progress progress("compare with the cameras", std::ssize(frames));
  for (const int64_t frame : frames) {
    stop_if_interrupted();
    const CompactFrame compact = meshes.read(frame);
    require_held_out(compact, request.cameras);
    const auto views = recorded.read(frame);
    const auto truth = truth_like(compact.mesh, request.truth, frame);
    std::optional<FrameColours> colours;
    if (request.view_dependent || truth) colours.emplace(evaluated.take, compact);
    for (size_t i = 0; i < samples.size(); ++i) {
      if (!views[i]) continue;
      const RigCamera& eye = recorded.rig()[i];
      const HeldOutView view(eye, *views[i]);
      if (view.inside().count() == 0) continue;
      samples[i].add(
          view, request.view_dependent ? colours->seen_by(eye.model, compact.mesh) : compact.mesh,
          eye.model);
      if (!truth) continue;
      samples[i].add_truth(view, request.view_dependent ? colours->seen_by(eye.model, *truth)
                                                        : colours->coloured(*truth));
    }
    progress.advance();
  }
  std::vector<HeldOutReport> reports;
  for (size_t i = 0; i < samples.size(); ++i) {
    reports.push_back(samples[i].report(request.cameras[i]));
  }
  return reports;
}

}  // namespace v3d::ctl
