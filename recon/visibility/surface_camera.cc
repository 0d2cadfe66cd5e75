#include "recon/visibility/surface_camera.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>

#include "recon/render/screen_vertex.h"

namespace v3d {
namespace {

constexpr int kMaxHalvings = 8;

}  // namespace

SurfaceCamera::SurfaceCamera(const DeformCamera& camera, int halvings)
    : frame_(camera.frame),
      lens_(camera_of_metres(*camera.model)),
      center_(camera.model->center().cast<float>()) {
  pictures_[0] = Luminance(*frame_);
  for (; halvings > 0; --halvings) pictures_[0] = pictures_[0].halved();
  for (int level = 1; level < kLevels; ++level) {
    pictures_[level] = pictures_[level - 1].halved();
  }
}

std::optional<SurfaceCamera::Seen> SurfaceCamera::project(const Eigen::Vector3f& place) const {
  const auto p = camera_point<float>(lens_, place.x(), place.y(), place.z());
  if (p.z < static_cast<float>(kNearPlaneMetres)) return std::nullopt;
  const PixelPoint<float> pixel = pixel_point(lens_, p);
  if (!(pixel.radius2 <= lens_.max_radius2)) return std::nullopt;
  return Seen{{pixel.u, pixel.v}, p.z};
}

bool SurfaceCamera::sees(const Seen& seen, const DepthBuffer& depth, float tolerance_m) const {
  return in_silhouette(seen.pixel) &&
         seen.z <= depth.at(static_cast<int>(seen.pixel.x()), static_cast<int>(seen.pixel.y())) +
                       tolerance_m;
}

SurfaceCameras::SurfaceCameras(std::span<const DeformCamera> given, const Mesh& mesh,
                               double voxel_m) {
  std::vector<const DeformCamera*> with_pixels;
  for (const DeformCamera& camera : given) {
    if (!camera.frame->roi.empty()) with_pixels.push_back(&camera);
  }
  const Eigen::Vector3f middle = vertex_centroid(mesh);
  std::vector<std::optional<SurfaceCamera>> made(with_pixels.size());
  tbb::parallel_for(size_t{0}, made.size(), [&](size_t c) {
    made[c].emplace(*with_pixels[c], redundant_halvings(*with_pixels[c]->model, middle, voxel_m));
  });
  for (size_t c = 0; c < made.size(); ++c) {
    cameras.push_back(std::move(*made[c]));
    models.push_back(*with_pixels[c]->model);
  }
}

int redundant_halvings(const CameraModel& camera, const Eigen::Vector3f& place, double voxel_m) {
  const double z = (camera.cam_from_world() * place.cast<double>()).z();
  const double pixel_m = z / camera.matrix()(0, 0);
  if (!(pixel_m > 0)) return 0;
  return std::clamp(static_cast<int>(std::ceil(std::log2(voxel_m / 4 / pixel_m))), 0, kMaxHalvings);
}

Eigen::Vector3f vertex_centroid(const Mesh& mesh) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3f& vertex : mesh.vertices) sum += vertex.cast<double>();
  if (!mesh.vertices.empty()) sum /= static_cast<double>(mesh.vertices.size());
  return sum.cast<float>();
}

}  // namespace v3d
