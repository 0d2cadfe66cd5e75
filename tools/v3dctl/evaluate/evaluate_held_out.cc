#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <limits>

#include "base/core/error.h"
#include "base/core/statistics.h"
#include "base/core/text.h"
#include "base/image/colour.h"
#include "common/console.h"
#include "daemon/recorded/mesh_frames.h"
#include "daemon/recorded/take_frames.h"
#include "recon/mesh/mesh_neighbours.h"
#include "recon/render/renderer.h"
#include "recon/texture/colour_mask.h"
#include "v3dctl/evaluate/evaluate.h"

namespace v3d::ctl {
namespace {

void require_held_out(const recon::CompactFrame& frame, const std::vector<std::string>& cameras) {
  for (const std::string& camera : cameras) {
    if (std::find(frame.cameras.begin(), frame.cameras.end(), camera) == frame.cameras.end())
      continue;
    throw InputError("--held-out " + camera + ": took part in frame " +
                     std::to_string(frame.pulse) + "; first reconstruct with --leave-out " +
                     camera);
  }
}

ImageSimilarity compare_images(const Image& rendering, const Image& photograph, const Mask& where) {
  return {recon::psnr_db(rendering.view(), photograph.view(), where),
          recon::ssim(rendering.view(), photograph.view(), where)};
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
    iou_.push_back(intersection_over_union(recon::draw_silhouette(mesh, camera), view.mask()));
  }
  void add_atlas(const HeldOutView& view, const Mesh& mesh, const recon::TextureAtlas& atlas) {
    atlas_.push_back(compare_images(view.render(mesh, &atlas), view.photograph(), view.inside()));
  }
  void add_truth(const HeldOutView& view, const Mesh& truth) {
    truth_.push_back(compare_images(view.render(truth), view.photograph(), view.inside()));
  }
  void add_missing() { ++missing_; }
  HeldOutReport report(const std::string& camera) const {
    HeldOutReport report{.camera = camera,
                         .frames = std::ssize(iou_),
                         .missing = missing_,
                         .inside = mean_of(inside_),
                         .whole_mask = mean_of(whole_mask_),
                         .iou = mean(iou_),
                         .true_surface = {}};
    if (!atlas_.empty()) report.atlas = mean_of(atlas_);
    if (!truth_.empty()) report.true_surface = mean_of(truth_);
    return report;
  }

 private:
  std::vector<ImageSimilarity> inside_, whole_mask_, atlas_, truth_;
  std::vector<double> iou_;
  int64_t missing_ = 0;
};

/// Step between the coordinates that single precision can represent at the farthest vertex, metres.
double precision_of(const Mesh& mesh) {
  float farthest = 0;
  for (const Eigen::Vector3f& p : mesh.vertices) {
    farthest = std::max(farthest, p.cwiseAbs().maxCoeff());
  }
  return double{std::nextafter(farthest, std::numeric_limits<float>::infinity())} - farthest;
}

/// Throws InputError for a true surface that edges of `edge_m` metres would divide into more
/// triangles than memory holds, or that single precision cannot divide so finely.
void check_resampling(const std::string& file, const Mesh& true_surface, double edge_m) {
  constexpr double kMaxAdded = 1 << 23;
  constexpr double kEdgeShare = 1.0 / 16;
  const std::string edges = "edges as long as those of the mesh, " + format_length(edge_m);
  if (!(precision_of(true_surface) <= kEdgeShare * edge_m)) {
    throw InputError(file + ": is too far from the origin for " + edges +
                     "; expected metres in the coordinates of the take");
  }
  if (!(recon::added_triangles(true_surface, edge_m) <= kMaxAdded)) {
    throw InputError(file + ": would have more than " + format_count(1 << 23) +
                     " further triangles with " + edges +
                     "; expected metres in the coordinates of the take");
  }
}

/// True surface with about the vertex spacing of `mesh`, so that vertex colours are comparable.
/// Empty without a file, and for a mesh without a length.
std::optional<Mesh> read_resampled_truth(const Mesh& mesh, const std::filesystem::path& truth,
                                         int64_t frame) {
  const double edge_m = recon::mean_edge(mesh);
  if (truth.empty() || !(edge_m > 0)) return {};
  const auto true_surface = read_truth(truth, frame);
  if (!true_surface) return {};
  check_resampling(truth_path(truth, frame).string(), *true_surface, edge_m);
  return recon::with_short_edges(*true_surface, edge_m);
}

}  // namespace

std::vector<HeldOutReport> evaluate_held_out(const EvaluatedMeshes& evaluated,
                                             const HeldOutRequest& request) {
  recorded::MeshFrames meshes = open_meshes(evaluated);
  meshes.enable_views(request.view_dependent);
  recorded::TakeFrames recorded(evaluated.take, request.cameras);
  std::optional<recorded::TakeFrames> opened;
  const auto photographs = [&]() -> recorded::TakeFrames& {
    const take::TakePaths paths{evaluated.take};
    if (!opened) opened.emplace(evaluated.take, recorded::recorded_cameras(paths));
    return *opened;
  };
  std::vector<HeldOutSamples> samples(request.cameras.size());
  const std::vector<int64_t> frames = meshes.frames({});
  Progress progress("compare with the cameras", std::ssize(frames));
  for (const int64_t frame : frames) {
    stop_if_interrupted();
    const recon::CompactFrame compact = meshes.read(frame);
    require_held_out(compact, request.cameras);
    const auto views = recorded.read(frame);
    const auto truth = read_resampled_truth(compact.mesh, request.truth, frame);
    std::optional<recorded::FrameColours> colours;
    if (request.atlas_side > 0 || truth) colours.emplace(photographs(), compact);
    std::optional<recorded::ViewColours> views_of_mesh;
    if (request.view_dependent && request.view_source == recorded::ViewSource::kMesh) {
      views_of_mesh.emplace(evaluated.take, compact, request.view_source);
    } else if (request.view_dependent) {
      views_of_mesh.emplace(photographs(), compact);
    }
    std::optional<recon::TextureAtlas> atlas;
    if (request.atlas_side > 0 && !compact.mesh.triangles.empty()) {
      atlas = colours->atlas(compact.mesh, request.atlas_side);
    }
    for (size_t i = 0; i < samples.size(); ++i) {
      if (!views[i]) {
        samples[i].add_missing();
        continue;
      }
      const RigCamera& camera = recorded.rig()[i];
      const HeldOutView view(camera, *views[i]);
      if (view.inside().count() == 0) continue;
      samples[i].add(
          view, request.view_dependent ? views_of_mesh->coloured_for(camera.model) : compact.mesh,
          camera.model);
      if (atlas) samples[i].add_atlas(view, compact.mesh, *atlas);
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

namespace {

constexpr int kMarginPx = 12;  // around the foreground
constexpr int kMaxGreyDifference = 64;

Mask inside_of(const recorded::SegmentedFrame& segmented) {
  const Mask& mask = segmented.mask;
  Frame frame;
  frame.sensor_size = mask.size();
  frame.roi = {0, 0, mask.size().width, mask.size().height};
  frame.mask = mask;
  frame.background_difference = segmented.background_difference;
  const recon::ColourMask colours(frame);
  Mask inside(mask.size());
  for (int y = 0; y < mask.size().height; ++y) {
    for (int x = 0; x < mask.size().width; ++x) {
      if (colours.inner(x, y)) inside.set(x, y);
    }
  }
  return inside;
}

Image corrected(Image image, const ColourResponse& response) {
  correct(image, response);
  return image;
}

Rect with_margin(Rect r, ImageSize size) {
  const int x0 = std::max(0, r.x0 - kMarginPx), y0 = std::max(0, r.y0 - kMarginPx);
  return {x0, y0, std::min(size.width, r.x0 + r.width + kMarginPx) - x0,
          std::min(size.height, r.y0 + r.height + kMarginPx) - y0};
}

}  // namespace

HeldOutView::HeldOutView(const RigCamera& camera, const recorded::SegmentedFrame& frame)
    : camera_(camera),
      format_(frame.raw.image.format),
      mask_(frame.mask),
      inside_(inside_of(frame)),
      photograph_(corrected(to_rgb(frame.raw.image.view()), camera.colour)) {}

Image HeldOutView::render(const Mesh& mesh, const recon::TextureAtlas* atlas) const {
  return as_recorded(recon::draw_mesh(mesh, camera_.model, {.atlas = atlas}));
}

Image HeldOutView::as_recorded(Image rendering) const {
  if (!is_bayer(format_)) return rendering;
  correct(rendering, camera_.colour.inverse());
  return corrected(to_rgb(mosaic(rendering.view(), format_).view()), camera_.colour);
}

CroppedHeldOutView::CroppedHeldOutView(const RigCamera& camera,
                                       const recorded::SegmentedFrame& frame)
    : view_(camera, frame), region_(with_margin(frame.mask.bounding_box(), frame.mask.size())) {}

Image CroppedHeldOutView::photograph() const { return crop(view_.photograph()); }

Image CroppedHeldOutView::render(const Mesh& mesh, const recon::TextureAtlas* atlas) const {
  return crop(view_.render(mesh, atlas));
}

Image CroppedHeldOutView::difference(const Mesh& mesh, const recon::TextureAtlas* atlas) const {
  const Image rendering = view_.render(mesh, atlas);
  const Image& photograph = view_.photograph();
  Image difference(rendering.size, PixelFormat::kRGB8);
  for (int y = 0; y < rendering.size.height; ++y) {
    for (int x = 0; x < rendering.size.width; ++x) {
      if (!view_.inside().get(x, y)) continue;
      int max = 0;
      for (int i = 3 * x; i < 3 * x + 3; ++i) {
        max = std::max(max, std::abs(rendering.row(y)[i] - photograph.row(y)[i]));
      }
      const int grey = std::min(255, max * 255 / kMaxGreyDifference);
      std::fill_n(difference.row(y) + 3 * x, 3, static_cast<uint8_t>(grey));
    }
  }
  return crop(difference);
}

Image CroppedHeldOutView::crop(const Image& whole) const {
  Image part({region_.width, region_.height}, PixelFormat::kRGB8);
  for (int y = 0; y < region_.height; ++y) {
    std::copy_n(whole.row(region_.y0 + y) + 3 * region_.x0, 3 * region_.width, part.row(y));
  }
  return part;
}

}  // namespace v3d::ctl
