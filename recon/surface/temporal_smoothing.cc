#include "recon/surface/temporal_smoothing.h"

#include <algorithm>
#include <cmath>

#include "recon/mesh/neighbours.h"
#include "recon/mesh/self_intersection_removal.h"
#include "recon/mesh/smooth_surface.h"
#include "recon/mesh/vertex_loop.h"
#include "recon/surface/motion_mask.h"

namespace v3d {
namespace {

using Eigen::Vector2f;
using Eigen::Vector3f;

constexpr float kMinFacing = 0.3F;     ///< cosine; grazing views measure depth badly
constexpr float kHiddenBehind = 0.6F;  ///< voxels; see SurfaceCamera::sees()
constexpr float kMaxSlant = 6;     ///< largest change of depth within a pixel, in widths of a pixel
constexpr float kMaxDistance = 1;  ///< voxels; surfaces farther apart are different surfaces
constexpr int kNormalSmoothing = 2;

/// Evidence of one adjacent pulse for a vertex.
struct NeighbourEvidence {
  float static_part = 1;  ///< 0 where the image changed; minimum over cameras
  float weight = 0;       ///< sum over cameras that see both surfaces
  float sum_m = 0;        ///< weight times displacement to the other surface along the normal
};

/// Projection of a vertex into a camera.
struct VertexView {
  SurfaceCamera::Seen seen;
  float facing = 0;     ///< cosine
  float per_depth = 0;  ///< metres along the normal for a metre of camera z
};

std::optional<VertexView> see(const PulseViews::View& view, const Vector3f& place,
                              const Vector3f& normal, float voxel) {
  const Vector3f way = place - view.camera.center();
  const float facing = -way.dot(normal) / way.norm();
  if (!(facing >= kMinFacing)) return std::nullopt;
  const auto seen = view.camera.project(place);
  if (!seen) return std::nullopt;
  const float slope = std::sqrt(std::max(0.0F, 1 - facing * facing)) / facing;
  const float slant = view.camera.pixel_m_per_m() * seen->z * std::min(slope, kMaxSlant);
  if (!view.camera.sees(*seen, view.depth, kHiddenBehind * voxel + slant)) return std::nullopt;
  return VertexView{*seen, facing, way.dot(normal) / seen->z};
}

void add_camera(const PulseViews::View& now, const PulseViews::View& then, const VertexView& vertex,
                float max_distance_m, NeighbourEvidence& evidence) {
  const Vector2f& pixel = vertex.seen.pixel;
  evidence.static_part =
      std::min(evidence.static_part, static_weight(now.camera, then.camera, pixel));
  if (!then.camera.in_silhouette(pixel)) return;
  const int x = static_cast<int>(pixel.x()), y = static_cast<int>(pixel.y());
  const float way = (then.depth.at(x, y) - now.depth.at(x, y)) * vertex.per_depth;
  if (!(std::abs(way) <= max_distance_m)) return;
  evidence.weight += vertex.facing;
  evidence.sum_m += vertex.facing * way;
}

NeighbourEvidence gather_evidence(const PulseViews& now, const PulseViews& then,
                                  const Vector3f& place, const Vector3f& normal, float voxel) {
  NeighbourEvidence evidence;
  for (size_t c = 0; c < now.cameras(); ++c) {
    const auto here = now.view(c), there = then.view(c);
    if (!here || !there) continue;
    if (const auto vertex = see(*here, place, normal, voxel)) {
      add_camera(*here, *there, *vertex, kMaxDistance * voxel, evidence);
    }
  }
  return evidence;
}

/// Minimum over a vertex and its neighbours: a static vertex beside a moving one may move next.
float min_static_weight(const std::vector<NeighbourEvidence>& evidence,
                        const Neighbours& neighbours, size_t v) {
  float static_part = evidence[v].static_part;
  for (const uint32_t n : neighbours.of(v))
    static_part = std::min(static_part, evidence[n].static_part);
  return static_part;
}

}  // namespace

void smooth_over_time(const PulseViews& now, std::span<const PulseViews* const> adjacent,
                      const TemporalSmoothingOptions& options, Mesh& mesh) {
  const auto voxel = static_cast<float>(options.voxel_m);
  const size_t count = mesh.vertices.size();
  const Neighbours neighbours(mesh);
  std::vector<Vector3f> normals = vertex_normals(mesh), start = mesh.vertices, work;
  smooth_normals(neighbours, kNormalSmoothing, normals, work);
  std::vector<float> sums(count, 0.0F), weights(count, 1.0F);
  std::vector<NeighbourEvidence> evidence(count);
  for (const PulseViews* then : adjacent) {
    for_each_vertex(count, [&](size_t v) {
      evidence[v] = gather_evidence(now, *then, mesh.vertices[v], normals[v], voxel);
    });
    for_each_vertex(count, [&](size_t v) {
      const NeighbourEvidence& w = evidence[v];
      if (!(w.weight > 0)) return;
      const float static_part = min_static_weight(evidence, neighbours, v);
      sums[v] += static_part * w.sum_m / w.weight;
      weights[v] += static_part;
    });
  }
  for_each_vertex(count, [&](size_t v) { mesh.vertices[v] += sums[v] / weights[v] * normals[v]; });
  remove_self_intersections(neighbours, start, options.lattice, mesh);
}

}  // namespace v3d
