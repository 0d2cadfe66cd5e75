#include <algorithm>

#include "base/core/error.h"
#include "base/core/statistics.h"
#include "common/console.h"
#include "daemon/recorded/frame_colours.h"
#include "daemon/recorded/take_frames.h"
#include "recon/mesh/mesh_edges.h"
#include "recon/render/renderer.h"
#include "v3dctl/evaluate/evaluate.h"
#include "v3dctl/evaluate/held_out_view.h"
#include "v3dctl/process.h"

namespace v3d::ctl {
namespace {

void require_held_out(const CompactFrame& frame, const std::vector<std::string>& cameras) {
  for (const std::string& camera : cameras) {
    if (std::find(frame.cameras.begin(), frame.cameras.end(), camera) == frame.cameras.end())
      continue;
    throw InputError("--held-out " + camera + ": took part in frame " +
                     std::to_string(frame.pulse) + "; first reconstruct with --leave-out " +
                     camera);
  }
}

ImageSimilarity compare_images(const Image& rendering, const Image& photograph, const Mask& where) {
  return {psnr_db(rendering.view(), photograph.view(), where),
          ssim(rendering.view(), photograph.view(), where)};
}

ImageSimilarity mean_of(const std::vector<ImageSimilarity>& frames) {
  ImageSimilarity mean;
  for (const ImageSimilarity& frame : frames) {
    mean.psnr_db += frame.psnr_db / static_cast<double>(frames.size());
    mean.ssim += frame.ssim / static_cast<double>(frames.size());
  }
  return mean;
}

/// Measures the frames of one camera.
class HeldOutSamples {
 public:
  void add(const HeldOutView& view, const Mesh& mesh, const CameraModel& camera) {
    const Image rendering = view.render(mesh);
    inside_.push_back(compare_images(rendering, view.photograph(), view.inside()));
    whole_mask_.push_back(compare_images(rendering, view.photograph(), view.mask()));
    iou_.push_back(intersection_over_union(draw_silhouette(mesh, camera), view.mask()));
  }
  void add_truth(const HeldOutView& view, const Mesh& truth) {
    truth_.push_back(compare_images(view.render(truth), view.photograph(), view.inside()));
  }
  HeldOutReport report(const std::string& camera) const {
    HeldOutReport report{
        camera, std::ssize(iou_), mean_of(inside_), mean_of(whole_mask_), mean(iou_), {}};
    if (!truth_.empty()) report.true_surface = mean_of(truth_);
    return report;
  }

 private:
  std::vector<ImageSimilarity> inside_, whole_mask_, truth_;
  std::vector<double> iou_;
};

/// True surface with about the vertex spacing of `mesh`, so that vertex colours are comparable.
std::optional<Mesh> read_resampled_truth(const Mesh& mesh, const std::filesystem::path& truth,
                                         int64_t frame) {
  if (truth.empty() || mesh.triangles.empty()) return {};
  const auto true_surface = read_truth(truth, frame);
  return true_surface ? std::optional(with_short_edges(*true_surface, mean_edge(mesh)))
                      : std::nullopt;
}

}  // namespace

std::vector<HeldOutReport> evaluate_held_out(const EvaluatedMeshes& evaluated,
                                             const HeldOutRequest& request) {
  MeshFrames meshes = open_meshes(evaluated);
  TakeFrames recorded(evaluated.take, request.cameras);
  std::vector<HeldOutSamples> samples(request.cameras.size());
  const std::vector<int64_t> frames = meshes.frames({});
  Progress progress("compare with the cameras", std::ssize(frames));
  for (const int64_t frame : frames) {
    stop_if_interrupted();
    const CompactFrame compact = meshes.read(frame);
    require_held_out(compact, request.cameras);
    const auto views = recorded.read(frame);
    const auto truth = read_resampled_truth(compact.mesh, request.truth, frame);
    std::optional<FrameColours> colours;
    if (request.view_dependent || truth) colours.emplace(evaluated.take, compact);
    for (size_t i = 0; i < samples.size(); ++i) {
      if (!views[i]) continue;
      const RigCamera& camera = recorded.rig()[i];
      const HeldOutView view(camera, *views[i]);
      if (view.inside().count() == 0) continue;
      samples[i].add(
          view,
          request.view_dependent ? colours->coloured_for(camera.model, compact.mesh) : compact.mesh,
          camera.model);
      if (!truth) continue;
      samples[i].add_truth(view, request.view_dependent
                                     ? colours->coloured_for(camera.model, *truth)
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
