#include "recon/motion/observation.h"

#include <limits>
#include <utility>

#include "recon/mesh/mesh_neighbours.h"

namespace v3d::recon {
namespace {

constexpr float kMinFacing = 0.25F;    ///< cosine between normal and direction to a camera
constexpr float kToleranceM = 0.015F;  ///< behind the surface in a depth buffer

}  // namespace

SurfaceSamples every_nth(const Mesh& mesh, std::span<const Eigen::Vector3f> normals, size_t n) {
  SurfaceSamples samples;
  for (size_t v = 0; v < mesh.vertices.size(); v += n) {
    samples.positions.push_back(mesh.vertices[v]);
    samples.normals.push_back(normals[v]);
  }
  return samples;
}

std::vector<uint8_t> visible_camera_counts(std::span<const Eigen::Vector3f> positions,
                                           std::span<const Eigen::Vector3f> normals,
                                           const SurfaceCameras& cameras,
                                           std::span<const DepthBuffer> depths) {
  std::vector<uint8_t> count(positions.size(), 0);
  for_each_block<VertexVisibility::kCapacity>(count.size(), [&](size_t begin, size_t end) {
    BlockVisibility block;
    block.compute(positions.subspan(begin, end - begin), normals.subspan(begin, end - begin),
                  cameras.cameras, depths, {.min_facing = kMinFacing, .tolerance_m = kToleranceM});
    for (size_t v = begin; v < end; ++v) {
      for (const VertexVisibility& camera : block.by_camera()) {
        count[v] = static_cast<uint8_t>(count[v] + (camera.seen[v - begin] >= kMinFacing ? 1 : 0));
      }
    }
  });
  return count;
}

ObservedSurface::ObservedSurface(std::shared_ptr<const ObservedPulse> pulse)
    : pulse_(std::move(pulse)), normals_(vertex_normals(pulse_->surface)), tree_(pulse_->surface) {}

std::optional<ObservedSurface::Nearest> ObservedSurface::nearest(const Eigen::Vector3f& position,
                                                                 double radius_m) const {
  const auto found = tree_.find(position.cast<double>());
  if (!found || found->distance > radius_m) return std::nullopt;
  const Mesh& mesh = pulse_->surface;
  return Nearest{
      interpolated(mesh, mesh.vertices, found->triangle, found->weights).cast<float>(),
      interpolated(mesh, normals_, found->triangle, found->weights).cast<float>().normalized()};
}

double ObservedSurface::distance(const Eigen::Vector3d& position) const {
  const auto found = tree_.find(position);
  return found ? found->distance : std::numeric_limits<double>::infinity();
}

}  // namespace v3d::recon
