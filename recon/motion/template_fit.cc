#include "recon/motion/template_fit.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>

#include "base/core/statistics.h"

namespace v3d::recon {
namespace {

using Eigen::Vector3f;

constexpr float kUnseenWeight = 0.03F;  ///< of a target of a vertex that no camera sees
constexpr float kPatchWeight = 4;       ///< of a match with full precision
constexpr size_t kReverseEvery = 16;    ///< every n-th vertex of the observed surface
constexpr int kSolverIterations = 2;
constexpr double kMaxDistanceM = 0.2;

constexpr float kMinDisplacedFacing = 0.5F;  ///< cosine of the normals
constexpr int kFullWeightCameras = 3;
constexpr int kSmoothingSweeps = 40;
constexpr float kSmoothness = 0.1F, kHold = 0.005F;

/// Tukey's weight: 1 at distance 0, 0 from `limit` on.
float robust_weight(float distance, float limit) {
  const float share = distance / limit;
  return share < 1 ? (1 - share * share) * (1 - share * share) : 0;
}

/// The pixels at which a depth buffer has a surface.
Mask drawn_pixels(const DepthBuffer& depth) {
  Mask mask(depth.size);
  for (int y = 0; y < depth.size.height; ++y) {
    for (int x = 0; x < depth.size.width; ++x) {
      if (std::isfinite(depth.at(x, y))) mask.set(x, y);
    }
  }
  return mask;
}

/// Mean of the cameras; 1 without cameras.
double silhouette_iou(const SurfaceCameras& cameras, std::span<const DepthBuffer> depths) {
  std::vector<double> of_camera(cameras.cameras.size());
  for_each_block<1>(of_camera.size(), [&](size_t c, size_t) {
    of_camera[c] =
        intersection_over_union(drawn_pixels(depths[c]), cameras.cameras[c].silhouette());
  });
  return of_camera.empty() ? 1 : mean(of_camera);
}

void append_used(const std::vector<VertexTarget>& from, std::vector<VertexTarget>& to) {
  for (const VertexTarget& target : from) {
    if (target.weight > 0) to.push_back(target);
  }
}

/// A sample counts for the residual when this many cameras see it: two, or 0 where no sample has
/// two, as with a single camera. Otherwise every template would fit such a pulse.
int cameras_that_prove(std::span<const uint8_t> cameras) {
  const bool any = std::ranges::any_of(cameras, [](uint8_t count) { return count >= 2; });
  return any ? 2 : 0;
}

}  // namespace

TemplateFit::TemplateFit(Mesh rest, const TrackingOptions& options)
    : rest_(std::move(rest)),
      moved_(rest_),
      neighbours_(rest_),
      graph_(rest_, options.node_spacing_m),
      solver_(graph_, rest_.vertices),
      patches_(rest_, options.patch_spacing_m),
      photometry_(options.photometry) {}

void TemplateFit::move(const std::vector<NodeMotion>& motion) {
  graph_.move(motion, rest_.vertices, moved_.vertices);
  normals_ = vertex_normals(moved_);
}

void TemplateFit::pose(const ObservedSurface& now, const std::vector<NodeMotion>& motion) {
  move(motion);
  const SurfaceCameras& cameras = now.pulse().cameras;
  if (cameras.cameras.empty()) {
    visible_in_.assign(moved_.vertices.size(), 2);
    return;
  }
  draw_depths(moved_, cameras.models, depths_, Faces::kFront);
  visible_in_ = visible_camera_counts(moved_.vertices, normals_, cameras, depths_);
  if (photometry_) patch_rotations_ = patches_.rotations(graph_, motion);
}

void TemplateFit::learn_patches(const ObservedSurface& now) {
  if (uses_images(now)) patches_.learn(surface_views(now), patch_rotations_);
}

void TemplateFit::fit(const ObservedSurface& now, std::span<const FitStage> stages,
                      std::vector<NodeMotion>& motion) {
  matches_ = {};
  for (const FitStage& stage : stages) run_stage(now, stage, motion);
  pose(now, motion);
}

void TemplateFit::run_stage(const ObservedSurface& now, const FitStage& stage,
                            std::vector<NodeMotion>& motion) {
  pose(now, motion);
  std::vector<VertexTarget> patches;
  if (uses_images(now) && stage.reach_m >= 0) add_patch_targets(now, stage, patches);
  for (int repeat = 0; repeat < stage.repeats; ++repeat) {
    if (repeat > 0) move(motion);
    std::vector<VertexTarget> targets = patches;
    add_surface_targets(now, stage, targets);
    if (stage.reverse) add_reverse_targets(now, stage, targets);
    solver_.solve(
        targets,
        {.rigidity = stage.rigidity, .bending = stage.bending, .iterations = kSolverIterations},
        motion);
  }
}

void TemplateFit::add_surface_targets(const ObservedSurface& now, const FitStage& stage,
                                      std::vector<VertexTarget>& targets) const {
  std::vector<VertexTarget> all(moved_.vertices.size());
  const auto radius = static_cast<float>(stage.radius_m);
  for_each_vertex(all.size(), [&](size_t v) {
    const Vector3f& position = moved_.vertices[v];
    const auto on = now.nearest(position, stage.radius_m);
    if (!on || on->normal.dot(normals_[v]) < static_cast<float>(stage.min_facing)) return;
    const float weight = robust_weight((on->position - position).norm(), radius);
    all[v] = {static_cast<uint32_t>(v), visible_in_[v] > 0 ? weight : kUnseenWeight * weight,
              on->normal, on->position};
  });
  append_used(all, targets);
}

/// Observed samples that the template does not reach pull its nearest vertex.
void TemplateFit::add_reverse_targets(const ObservedSurface& now, const FitStage& stage,
                                      std::vector<VertexTarget>& targets) const {
  const NearestTriangle tree(moved_);
  const SurfaceSamples samples = every_nth(now.mesh(), now.normals(), kReverseEvery);
  const double radius = 2 * stage.radius_m;
  std::vector<VertexTarget> all(samples.positions.size());
  for_each_vertex(all.size(), [&](size_t i) {
    const Vector3f& position = samples.positions[i];
    const auto found = tree.find(position.cast<double>());
    if (!found || found->distance > radius) return;
    int corner = 0;
    found->weights.maxCoeff(&corner);
    const uint32_t vertex = moved_.triangles[found->triangle][static_cast<size_t>(corner)];
    if (normals_[vertex].dot(samples.normals[i]) < static_cast<float>(stage.min_facing)) return;
    // The vertex moves as the nearest point of the template should.
    const Vector3f way =
        position -
        interpolated(moved_, moved_.vertices, found->triangle, found->weights).cast<float>();
    all[i] = {vertex, robust_weight(way.norm(), static_cast<float>(radius)), samples.normals[i],
              moved_.vertices[vertex] + way};
  });
  append_used(all, targets);
}

void TemplateFit::add_patch_targets(const ObservedSurface& now, const FitStage& stage,
                                    std::vector<VertexTarget>& targets) {
  matches_ = patches_.match(surface_views(now), patch_rotations_, stage.reach_m);
  for (const PatchMatch& match : matches_.found) {
    for (size_t k = 0; k < match.directions.size(); ++k) {
      targets.push_back(
          {match.vertex, kPatchWeight * match.precision[k], match.directions[k], match.position});
    }
  }
}

NormalDisplacements TemplateFit::normal_displacements(const ObservedSurface& now,
                                                      float limit_m) const {
  const size_t count = moved_.vertices.size();
  NormalDisplacements detail{std::vector<float>(count, 0), std::vector<float>(count, 0)};
  for_each_vertex(count, [&](size_t v) {
    if (visible_in_[v] == 0) return;
    const Vector3f& position = moved_.vertices[v];
    const auto on = now.nearest(position, double{limit_m});
    if (!on || on->normal.dot(normals_[v]) < kMinDisplacedFacing) return;
    const float along = normals_[v].dot(on->position - position);
    const int cameras = std::min<int>(visible_in_[v], kFullWeightCameras);
    detail.target[v] = along;
    detail.weight[v] =
        static_cast<float>(cameras) / kFullWeightCameras * robust_weight(std::abs(along), limit_m);
  });
  return detail;
}

std::vector<float> TemplateFit::displacements(const NormalDisplacements& detail) const {
  const size_t count = detail.target.size();
  std::vector<float> field(count, 0), next(count);
  for (int sweep = 0; sweep < kSmoothingSweeps; ++sweep) {
    for_each_vertex(count, [&](size_t v) {
      float sum = detail.weight[v] * detail.target[v], weight = detail.weight[v] + kHold;
      for (const uint32_t n : neighbours_.of(v)) {
        sum += kSmoothness * field[n];
        weight += kSmoothness;
      }
      next[v] = sum / weight;
    });
    std::swap(field, next);
  }
  return field;
}

PulseResidual TemplateFit::residual(const ObservedSurface& now, double far_m) const {
  const SurfaceSamples samples = every_nth(now.mesh(), now.normals(), kReverseEvery);
  // Where the template misses a part, cameras see this part before the template.
  std::vector<uint8_t> seen(samples.positions.size(), 2);
  if (!now.pulse().cameras.cameras.empty()) {
    seen = visible_camera_counts(samples.positions, samples.normals, now.pulse().cameras, depths_);
  }
  const NearestTriangle tree(moved_);
  std::vector<double> distances(samples.positions.size(), -1);
  const int enough = cameras_that_prove(seen);
  for_each_vertex(distances.size(), [&](size_t i) {
    if (seen[i] < enough) return;
    const auto found = tree.find(samples.positions[i].cast<double>());
    if (found) distances[i] = found->distance;
  });
  std::erase_if(distances, [](double d) { return d < 0; });
  PulseResidual result;
  if (distances.empty()) return result;
  const auto share_far = [&](const std::vector<double>& all) {
    const auto far = std::ranges::count_if(all, [&](double d) { return d > far_m; });
    return static_cast<double>(far) / static_cast<double>(std::max<size_t>(all.size(), 1));
  };
  result.far = share_far(distances);
  result.surplus = share_far(seen_distances(now));
  result.median_m = percentile(distances, 0.5);
  result.p90_m = percentile(distances, 0.9);
  result.silhouette_iou = silhouette_iou(now.pulse().cameras, depths_);
  if (uses_images(now)) {
    std::vector<double> correlations;
    for (const PatchMatch& match : matches_.found) {
      correlations.push_back(double{match.correlation});
    }
    result.matched_patches = std::ssize(matches_.found);
    result.correlation = correlations.empty() ? 0 : percentile(correlations, 0.5);
  }
  return result;
}

/// Distances from the seen vertices of the template to the observed surface.
std::vector<double> TemplateFit::seen_distances(const ObservedSurface& now) const {
  std::vector<double> distances(moved_.vertices.size(), -1);
  const int enough = cameras_that_prove(visible_in_);
  for_each_vertex(distances.size(), [&](size_t v) {
    if (visible_in_[v] >= enough) distances[v] = now.distance(moved_.vertices[v].cast<double>());
  });
  std::erase_if(distances, [](double d) { return d < 0; });
  return distances;
}

std::vector<double> TemplateFit::node_distances(const ObservedSurface& now,
                                                std::span<const NodeMotion> motion) {
  std::vector<double> distances(motion.size());
  for_each_vertex(motion.size(), [&](size_t n) {
    distances[n] = std::min(now.distance(motion[n].position), kMaxDistanceM);
  });
  return distances;
}

namespace {

constexpr float kFullCameras = 3;
constexpr float kResidualM = 0.01F;  ///< at which the confidence falls to 1/e
constexpr uint8_t kMaxMissing = 10;  ///< pulses
constexpr float kLostFactor = 0.5F;  ///< of a patch that was missing for so long

float factor_of(float square_m2) { return std::exp(-square_m2 / (kResidualM * kResidualM)); }

/// Squared distance from `position` to the match, as far as the texture of the patch measures it.
float squared_slip(const PatchMatch& match, const Vector3f& position) {
  float sum = 0;
  for (size_t k = 0; k < match.directions.size(); ++k) {
    const float along = match.directions[k].dot(match.position - position);
    sum += match.precision[k] * along * along;
  }
  return sum;
}

}  // namespace

std::vector<float> VertexConfidence::patch_factors(const TemplateFit& fit) {
  const std::vector<Vector3f>& vertices = fit.vertices();
  const PatchMatches& matches = fit.patch_matches();
  missing_.resize(vertices.size(), 0);
  std::vector<float> factors(vertices.size(), 1);
  for (const PatchMatch& match : matches.found) {
    missing_[match.vertex] = 0;
    factors[match.vertex] = factor_of(squared_slip(match, vertices[match.vertex]));
  }
  for (const uint32_t vertex : matches.missing) {
    if (missing_[vertex] < kMaxMissing) ++missing_[vertex];
  }
  for (size_t v = 0; v < factors.size(); ++v) {
    factors[v] *= 1 - (1 - kLostFactor) * static_cast<float>(missing_[v]) / kMaxMissing;
  }
  return factors;
}

std::vector<uint8_t> VertexConfidence::of_pulse(const TemplateFit& fit,
                                                const NormalDisplacements& detail) {
  const std::vector<float> patches = patch_factors(fit);
  const std::vector<uint8_t>& cameras = fit.visible_cameras();
  std::vector<uint8_t> confidences(cameras.size(), 0);
  for (size_t v = 0; v < confidences.size(); ++v) {
    if (detail.weight[v] <= 0) continue;
    const uint32_t patch = fit.nearest_patch(v);
    const float seen = std::min(static_cast<float>(cameras[v]) / kFullCameras, 1.0F);
    const float texture = patch == SurfacePatches::kNoPatch ? 1.0F : patches[patch];
    const float factor = seen * texture * factor_of(detail.target[v] * detail.target[v]);
    confidences[v] = static_cast<uint8_t>(255 * factor + 0.5F);
  }
  return confidences;
}

}  // namespace v3d::recon
