#include "recon/texture/vertex_cameras.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>

#include "base/image/demosaic.h"

namespace v3d {
namespace {

Eigen::Vector3f centroid(const PointArrays& points) {
  if (points.count == 0) {
    return Eigen::Vector3f::Zero();
  }
  const auto mean = [&](const std::vector<float>& array) {
    double sum = 0;
    for (size_t i = 0; i < points.count; ++i) {
      sum += array[i];
    }
    return static_cast<float>(sum / static_cast<double>(points.count));
  };
  return {mean(points.x), mean(points.y), mean(points.z)};
}

/// Resolution of a typical camera on the surface: weights by resolution are about 1.
constexpr float kUsualPixelsPerMetre = 300;

/// Weight of Algorithm 2, at most 1. It has a constant factor, which equation (7) removes by
/// normalisation.
float weight_of(const CameraModel& camera, const ViewDependence& view) {
  const double cosine = view.direction.dot(camera.viewing_direction());
  return static_cast<float>(std::pow((cosine + 2) / 3, view.sharpness));
}

}  // namespace

std::vector<VertexCamera> vertex_cameras(const PointArrays& occluders,
                                         std::vector<TextureCamera> cameras,
                                         const TextureOptions& options) {
  std::erase_if(cameras, [](const TextureCamera& c) { return c.frame->roi.empty(); });
  std::sort(cameras.begin(), cameras.end(),
            [](const auto& a, const auto& b) { return a.frame->camera < b.frame->camera; });
  const Eigen::Vector3f middle = centroid(occluders);
  std::vector<VertexCamera> prepared(cameras.size());
  tbb::parallel_for(size_t{0}, cameras.size(), [&](size_t c) {
    const CameraModel& model = *cameras[c].model;
    VertexCamera& camera = prepared[c];
    camera.lens = camera_of_metres(model);
    camera.axis = model.viewing_direction().cast<float>();
    camera.frame = cameras[c].frame;
    if (options.demosaic) camera.demosaiced = to_rgb(camera.frame->image.view());
    camera.mask = ColourMask(*camera.frame);
    if (const ColourResponse* colour = cameras[c].colour; colour && !colour->is_identity()) {
      camera.colour = SampleCorrection(*colour);
    }
    if (options.view) camera.weight = weight_of(model, *options.view);
    if (options.by_resolution) {
      camera.resolution = static_cast<float>(model.matrix()(0, 0)) / kUsualPixelsPerMetre;
    }
    camera.depth = PointDepthBuffer(occluders, middle, options.occluder_radius_m, model,
                                    camera.lens, camera.frame->roi);
    camera.tolerance_m = static_cast<float>(options.depth_tolerance_m);
    camera.max_slant = static_cast<float>(options.max_slant);
    camera.cell_m_per_m =
        camera.depth.grid().cell_width() / static_cast<float>(model.matrix()(0, 0));
  });
  return prepared;
}

}  // namespace v3d
