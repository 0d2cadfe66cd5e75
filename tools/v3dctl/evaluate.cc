#include "v3dctl/evaluate.h"

#include <algorithm>
#include <cstdio>

#include "base/error.h"
#include "common/console.h"
#include "common/ply_reader.h"
#include "recon/renderer.h"
#include "recon/self_intersection.h"
#include "recon/silhouette.h"
#include "v3dctl/interrupt.h"
#include "v3dctl/mesh_frames.h"
#include "v3dctl/statistics.h"
#include "v3dctl/take_frames.h"
#include "v3dctl/view_colours.h"

namespace v3d::ctl {
namespace {

namespace fs = std::filesystem;

fs::path truth_of(const fs::path& folder, int64_t frame) {
  char name[32];
  std::snprintf(name, sizeof name, "%06lld.ply", static_cast<long long>(frame));
  return folder / name;
}

SurfaceDistance median_of(const std::vector<SurfaceDistance>& frames) {
  constexpr double SurfaceDistance::*kFigures[] = {
      &SurfaceDistance::accuracy_p50_mm,     &SurfaceDistance::accuracy_p90_mm,
      &SurfaceDistance::completeness_p50_mm, &SurfaceDistance::completeness_p90_mm,
      &SurfaceDistance::f_score_2mm,         &SurfaceDistance::f_score_5mm,
      &SurfaceDistance::f_score_10mm,        &SurfaceDistance::normal_error_deg};
  SurfaceDistance middle;
  for (const auto figure : kFigures) {
    std::vector<double> values;
    for (const SurfaceDistance& frame : frames) values.push_back(frame.*figure);
    middle.*figure = median(values);
  }
  return middle;
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

struct Samples {
  std::vector<double> psnr, similarity, iou;
};

void compare_with_photograph(const Mesh& mesh, const CameraModel& camera,
                             const SegmentedFrame& frame, Samples& samples) {
  const Image drawn = draw_mesh(mesh, camera);
  const Image photograph = to_rgb(frame.raw.image.view());
  samples.psnr.push_back(psnr_db(drawn.view(), photograph.view(), frame.mask));
  samples.similarity.push_back(ssim(drawn.view(), photograph.view(), frame.mask));
  samples.iou.push_back(intersection_over_union(draw_silhouette(mesh, camera), frame.mask));
}

}  // namespace

TruthReport evaluate_truth(const fs::path& take, const fs::path& truth) {
  MeshFrames meshes(take);
  TruthReport report;
  std::vector<SurfaceDistance> distances;
  std::vector<double> crossings;
  const std::vector<int64_t> frames = meshes.frames({});
  Progress progress("compare with the truth", std::ssize(frames));
  for (const int64_t frame : frames) {
    stop_if_interrupted();
    const fs::path file = truth_of(truth, frame);
    if (fs::exists(file)) {
      const Mesh mesh = meshes.read(frame).mesh;
      distances.push_back(compare_surfaces(mesh, read_ply(file)));
      crossings.push_back(static_cast<double>(self_intersections(mesh).size()));
    } else {
      ++report.without_truth;
    }
    progress.advance();
  }
  if (distances.empty()) {
    throw InputError(
        truth_of(truth, frames.front()).string() +
        ": is not there, nor the truth of any other frame; want DIR/000012.ply for frame 12");
  }
  report.frames = std::ssize(distances);
  report.distance = median_of(distances);
  report.self_intersections = median(crossings);
  return report;
}

std::vector<HeldOutReport> evaluate_held_out(const fs::path& take,
                                             const std::vector<std::string>& cameras,
                                             bool view_dependent) {
  MeshFrames meshes(take);
  TakeFrames recorded(take, cameras);
  std::vector<Samples> samples(cameras.size());
  const std::vector<int64_t> frames = meshes.frames({});
  Progress progress("compare with the cameras", std::ssize(frames));
  for (const int64_t frame : frames) {
    stop_if_interrupted();
    const CompactFrame compact = meshes.read(frame);
    require_held_out(compact, cameras);
    const auto views = recorded.read(frame);
    std::optional<ViewColours> colours;
    if (view_dependent) colours.emplace(take, compact);
    for (size_t i = 0; i < cameras.size(); ++i) {
      if (!views[i] || views[i]->mask.count() == 0) continue;
      const CameraModel& eye = recorded.rig()[i].model;
      compare_with_photograph(colours ? colours->seen_by(eye, compact.mesh) : compact.mesh, eye,
                              *views[i], samples[i]);
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
