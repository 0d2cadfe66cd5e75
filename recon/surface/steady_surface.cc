#include "recon/surface/steady_surface.h"

#include <algorithm>
#include <cmath>

#include "recon/mesh/neighbours.h"
#include "recon/mesh/smooth_surface.h"
#include "recon/mesh/untangle.h"
#include "recon/mesh/vertex_loop.h"
#include "recon/surface/stillness.h"

namespace v3d {
namespace {

using Eigen::Vector2f;
using Eigen::Vector3f;

constexpr float kLeastFacing = 0.3F;   ///< cosine: what is seen at a glance tells little of depth
constexpr float kHiddenBehind = 0.6F;  ///< voxels; see SurfaceCamera::sees()
constexpr float kMostSlant = 6;        ///< pixels' widths of depth within a pixel
constexpr float kFarthest = 1;         ///< voxels: what lies farther away is something else
constexpr int kNormalSmoothing = 2;

/// What the moment beside says of a vertex.
struct Witness {
  float still = 1;   ///< 0 where something moved; the least of all cameras
  float weight = 0;  ///< of the cameras that see both surfaces
  float sum_m = 0;   ///< weight times the way along the normal to the other surface
};

/// A vertex as a camera sees it.
struct SeenVertex {
  SurfaceCamera::Seen seen;
  float facing = 0;     ///< cosine
  float per_depth = 0;  ///< metres along the normal for a metre of camera z
};

std::optional<SeenVertex> see(const Moment::View& view, const Vector3f& place,
                              const Vector3f& normal, float voxel) {
  const Vector3f way = place - view.camera.center();
  const float facing = -way.dot(normal) / way.norm();
  if (!(facing >= kLeastFacing)) return std::nullopt;
  const auto seen = view.camera.project(place);
  if (!seen) return std::nullopt;
  const float slope = std::sqrt(std::max(0.0F, 1 - facing * facing)) / facing;
  const float slant = view.camera.pixel_m_per_m() * seen->z * std::min(slope, kMostSlant);
  if (!view.camera.sees(*seen, view.depth, kHiddenBehind * voxel + slant)) return std::nullopt;
  return SeenVertex{*seen, facing, way.dot(normal) / seen->z};
}

void listen(const Moment::View& now, const Moment::View& then, const SeenVertex& vertex,
            float farthest_m, Witness& witness) {
  const Vector2f& pixel = vertex.seen.pixel;
  witness.still = std::min(witness.still, stillness(now.camera, then.camera, pixel));
  if (!then.camera.in_silhouette(pixel)) return;
  const int x = static_cast<int>(pixel.x()), y = static_cast<int>(pixel.y());
  const float way = (then.depth.at(x, y) - now.depth.at(x, y)) * vertex.per_depth;
  if (!(std::abs(way) <= farthest_m)) return;
  witness.weight += vertex.facing;
  witness.sum_m += vertex.facing * way;
}

Witness hear(const Moment& now, const Moment& then, const Vector3f& place, const Vector3f& normal,
             float voxel) {
  Witness witness;
  for (size_t c = 0; c < now.cameras(); ++c) {
    const auto here = now.view(c), there = then.view(c);
    if (!here || !there) continue;
    if (const auto vertex = see(*here, place, normal, voxel)) {
      listen(*here, *there, *vertex, kFarthest * voxel, witness);
    }
  }
  return witness;
}

/// What stands still beside something that moves may move the next moment: the least of a vertex
/// and its neighbours.
float least_still(const std::vector<Witness>& witnesses, const Neighbours& neighbours, size_t v) {
  float still = witnesses[v].still;
  for (const uint32_t n : neighbours.of(v)) still = std::min(still, witnesses[n].still);
  return still;
}

}  // namespace

void steady_surface(const Moment& now, std::span<const Moment* const> beside,
                    const SteadyOptions& options, Mesh& mesh) {
  const auto voxel = static_cast<float>(options.voxel_m);
  const size_t count = mesh.vertices.size();
  const Neighbours neighbours(mesh);
  std::vector<Vector3f> normals = vertex_normals(mesh), start = mesh.vertices, work;
  smooth_normals(neighbours, kNormalSmoothing, normals, work);
  std::vector<float> sums(count, 0.0F), weights(count, 1.0F);
  std::vector<Witness> witnesses(count);
  for (const Moment* then : beside) {
    for_each_vertex(count, [&](size_t v) {
      witnesses[v] = hear(now, *then, mesh.vertices[v], normals[v], voxel);
    });
    for_each_vertex(count, [&](size_t v) {
      const Witness& w = witnesses[v];
      if (!(w.weight > 0)) return;
      const float still = least_still(witnesses, neighbours, v);
      sums[v] += still * w.sum_m / w.weight;
      weights[v] += still;
    });
  }
  for_each_vertex(count, [&](size_t v) { mesh.vertices[v] += sums[v] / weights[v] * normals[v]; });
  untangle(neighbours, start, options.lattice, mesh);
}

}  // namespace v3d
