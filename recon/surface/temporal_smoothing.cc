#include "recon/surface/temporal_smoothing.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "recon/mesh/mesh_neighbours.h"
#include "recon/mesh/self_intersection.h"

namespace v3d::recon {
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

std::optional<VertexView> see(const PulseViews::View& view, const Vector3f& position,
                              const Vector3f& normal, float voxel) {
  const Vector3f way = position - view.camera.center();
  const float facing = -way.dot(normal) / way.norm();
  if (!(facing >= kMinFacing)) return std::nullopt;
  const auto seen = view.camera.project(position);
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
                                  const Vector3f& position, const Vector3f& normal, float voxel) {
  NeighbourEvidence evidence;
  for (size_t c = 0; c < now.cameras(); ++c) {
    const auto here = now.view(c), there = then.view(c);
    if (!here || !there) continue;
    if (const auto vertex = see(*here, position, normal, voxel)) {
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

namespace {

/// Half resolution has less noise and covers a wider area.
constexpr int kLevel = 1;
constexpr int kReach = 1;  ///< pixels of the level to each side that are compared
/// Mean differences of brightness. Without motion it is about 0.5 for the noise of a good camera
/// (1.5 grey values per pixel), and 1 for a bad one.
constexpr float kStill = 1.5F;
constexpr float kMoving = 3;
/// Largest change of an outline without motion, pixels of picture(0).
constexpr float kMaxOutlineShift = 3;

int lattice_coordinate(float at, float scale, float first) {
  return static_cast<int>(std::floor(at * scale - first + 0.5F));
}

/// Mean absolute difference around a pixel of the camera; empty beyond the border of an image.
std::optional<float> difference(const Luminance& a, const Luminance& b, const Vector2f& pixel) {
  constexpr int kRoom = Luminance::kBorder + kReach;
  const auto corner = [&](const Luminance& p) -> const uint32_t* {
    const int x = lattice_coordinate(pixel.x(), p.scale(), p.first_u());
    const int y = lattice_coordinate(pixel.y(), p.scale(), p.first_v());
    const bool inside = x >= kRoom && y >= kRoom && x < p.width() - kRoom && y < p.height() - kRoom;
    return inside ? p.quads() + static_cast<size_t>(y) * p.width() + x : nullptr;
  };
  const uint32_t *from = corner(a), *to = corner(b);
  if (from == nullptr || to == nullptr) return std::nullopt;
  int sum = 0;
  for (int dy = -kReach; dy <= kReach; ++dy) {
    for (int dx = -kReach; dx <= kReach; ++dx) {
      // The lowest byte of a quad is the pixel's own brightness.
      sum += std::abs(static_cast<int>(from[dy * a.width() + dx] & 255) -
                      static_cast<int>(to[dy * b.width() + dx] & 255));
    }
  }
  return static_cast<float>(sum) / ((2 * kReach + 1) * (2 * kReach + 1));
}

/// True when no foreground is near the pixel.
bool lost(const SurfaceCamera& camera, const Vector2f& pixel) {
  const float shift = kMaxOutlineShift * camera.coarseness();
  for (const Vector2f& aside : {Vector2f(0, 0), Vector2f(shift, 0), Vector2f(-shift, 0),
                                Vector2f(0, shift), Vector2f(0, -shift)}) {
    if (camera.in_silhouette(pixel + aside)) return false;
  }
  return true;
}

/// The picture of this scale; null where the camera has none.
const Luminance* picture_of(const SurfaceCamera& camera, float scale) {
  for (int level = 0; level < SurfaceCamera::kLevels; ++level) {
    if (camera.picture(level).scale() == scale) return &camera.picture(level);
  }
  return nullptr;
}

}  // namespace

float static_weight(const SurfaceCamera& now, const SurfaceCamera& then, const Vector2f& pixel) {
  if (lost(then, pixel)) return 0;
  // A performer who comes nearer or goes away changes the number of halvings by one.
  const float scale = std::max(now.picture(kLevel).scale(), then.picture(kLevel).scale());
  const Luminance *a = picture_of(now, scale), *b = picture_of(then, scale);
  const auto change = a != nullptr && b != nullptr ? difference(*a, *b, pixel) : std::nullopt;
  return change ? std::clamp((kMoving - *change) / (kMoving - kStill), 0.0F, 1.0F) : 0;
}

PulseViews::PulseViews(std::span<const CameraModel> models, std::span<const Frame* const> frames,
                       const Mesh& hull, double voxel_m)
    : frames_(models.size()), numbers_(models.size(), -1) {
  std::vector<DeformCamera> cameras;
  for (size_t c = 0; c < models.size(); ++c) {
    if (frames[c] == nullptr || frames[c]->roi.empty()) continue;
    frames_[c] = *frames[c];
    numbers_[c] = static_cast<int>(cameras.size());
    cameras.push_back({&models[c], &frames_[c]});
  }
  surface_cameras_ = SurfaceCameras(cameras, hull, voxel_m);
}

void PulseViews::set_surface(const Mesh& surface) {
  draw_depths(surface, surface_cameras_.models, depths_, Faces::kFront);
}

NeighbourSamples neighbour_samples(const PulseViews& now, const PulseViews& then) {
  NeighbourSamples samples{&then.stereo_samples, {}};
  for (size_t c = 0; c < then.numbers_.size(); ++c) {
    if (then.numbers_[c] < 0) continue;
    const int number = now.numbers_[c];
    samples.cameras.push_back({&then.surface_cameras_.cameras[then.numbers_[c]],
                               number >= 0 ? &now.surface_cameras_.cameras[number] : nullptr});
  }
  return samples;
}

}  // namespace v3d::recon
