#include "recon/metrics/evaluation.h"

#include <tbb/parallel_for.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <vector>

#include "base/core/statistics.h"
#include "recon/metrics/nearest_triangle.h"
#include "recon/metrics/surface_samples.h"

namespace v3d {
namespace {

struct Comparison {
  std::vector<double> distance_m;  ///< one per sample
  double mean_angle_deg = 0;
};

double angle_deg(const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  return std::atan2(a.cross(b).norm(), a.dot(b)) * 180 / std::numbers::pi;
}

Comparison compare(const std::vector<SurfaceSample>& samples, const Mesh& other) {
  const NearestTriangle nearest(other);
  const std::vector<Eigen::Vector3f> normals = vertex_normals(other);
  Comparison result;
  result.distance_m.resize(samples.size());
  std::vector<double> angle(samples.size());
  tbb::parallel_for(size_t{0}, samples.size(), [&](size_t i) {
    const auto point = nearest.find(samples[i].position);
    result.distance_m[i] = point->distance;
    angle[i] =
        angle_deg(samples[i].normal, interpolated(other, normals, point->triangle, point->weights));
  });
  for (const double a : angle) {
    result.mean_angle_deg += a / static_cast<double>(angle.size());
  }
  return result;
}

double part_within(const std::vector<double>& distances, double limit_m) {
  const auto count =
      std::count_if(distances.begin(), distances.end(), [&](double d) { return d <= limit_m; });
  return static_cast<double>(count) / static_cast<double>(distances.size());
}

double f_score(const Comparison& accuracy, const Comparison& completeness, double limit_m) {
  const double precision = part_within(accuracy.distance_m, limit_m);
  const double recall = part_within(completeness.distance_m, limit_m);
  return precision + recall > 0 ? 2 * precision * recall / (precision + recall) : 0;
}

constexpr double kStillM = 0.0002;
constexpr double kMovedM = 0.001;

/// Motion and errors at one point of the later reconstruction.
struct PointChange {
  double motion_m = 0;   ///< of the true surface at this point
  double flicker_m = 0;  ///< to the earlier reconstruction
  double error_m = 0;    ///< to the true surface of the later pulse
};

std::vector<PointChange> changes_of(const std::vector<SurfaceSample>& samples,
                                    const MeshAndTruth& before, const MeshAndTruth& now) {
  const NearestTriangle truth(*now.truth), truth_before(*before.truth), earlier(*before.mesh);
  std::vector<PointChange> changes(samples.size());
  tbb::parallel_for(size_t{0}, samples.size(), [&](size_t i) {
    const auto nearest = truth.find(samples[i].position);
    const Eigen::Vector3d place =
        interpolated(*now.truth, now.truth->vertices, nearest->triangle, nearest->weights);
    changes[i] = {truth_before.find(place)->distance, earlier.find(samples[i].position)->distance,
                  nearest->distance};
  });
  return changes;
}

struct Middle {
  double part = 0, p50_mm = 0, p90_mm = 0;
};

template <class Chosen>
Middle middle_of(const std::vector<PointChange>& changes, double PointChange::*figure,
                 const Chosen& chosen) {
  std::vector<double> values;
  for (const PointChange& change : changes) {
    if (chosen(change)) values.push_back(change.*figure);
  }
  if (values.empty()) return {};
  const double part = static_cast<double>(values.size()) / static_cast<double>(changes.size());
  return {part, 1000 * percentile(values, 0.5), 1000 * percentile(values, 0.9)};
}

SurfaceDistance without_surface(bool both) {
  if (both) {
    return {.f_score_2mm = 1,
            .f_score_5mm = 1,
            .f_score_10mm = 1,
            .covered_2mm = 1,
            .covered_5mm = 1,
            .covered_10mm = 1};
  }
  constexpr double kFar = std::numeric_limits<double>::infinity();
  return {.accuracy_p50_mm = kFar,
          .accuracy_p90_mm = kFar,
          .completeness_p50_mm = kFar,
          .completeness_p90_mm = kFar,
          .normal_error_deg = 180};
}

}  // namespace

SurfaceDistance compare_surfaces(const Mesh& reconstructed, const Mesh& truth,
                                 const SurfaceDistanceOptions& options) {
  const std::vector<SurfaceSample> from_result =
      sample_surface(reconstructed, options.samples, options.seed);
  const std::vector<SurfaceSample> from_truth =
      sample_surface(truth, options.samples, options.seed);
  if (from_result.empty() || from_truth.empty()) {
    return without_surface(from_result.empty() && from_truth.empty());
  }
  Comparison accuracy = compare(from_result, truth);
  Comparison completeness = compare(from_truth, reconstructed);
  SurfaceDistance d;
  d.f_score_2mm = f_score(accuracy, completeness, 0.002);
  d.f_score_5mm = f_score(accuracy, completeness, 0.005);
  d.f_score_10mm = f_score(accuracy, completeness, 0.010);
  d.covered_2mm = part_within(completeness.distance_m, 0.002);
  d.covered_5mm = part_within(completeness.distance_m, 0.005);
  d.covered_10mm = part_within(completeness.distance_m, 0.010);
  d.accuracy_p50_mm = 1000 * percentile(accuracy.distance_m, 0.5);
  d.accuracy_p90_mm = 1000 * percentile(accuracy.distance_m, 0.9);
  d.completeness_p50_mm = 1000 * percentile(completeness.distance_m, 0.5);
  d.completeness_p90_mm = 1000 * percentile(completeness.distance_m, 0.9);
  d.normal_error_deg = accuracy.mean_angle_deg;
  return d;
}

SurfaceChange compare_in_time(const MeshAndTruth& before, const MeshAndTruth& now,
                              const SurfaceDistanceOptions& options) {
  for (const Mesh* mesh : {before.mesh, before.truth, now.truth}) {
    if (mesh->triangles.empty()) return {};
  }
  const auto changes =
      changes_of(sample_surface(*now.mesh, options.samples, options.seed), before, now);
  const Middle still = middle_of(changes, &PointChange::flicker_m,
                                 [](const PointChange& c) { return c.motion_m <= kStillM; });
  const Middle moving = middle_of(changes, &PointChange::error_m,
                                  [](const PointChange& c) { return c.motion_m >= kMovedM; });
  return {.still = still.part,
          .flicker_p50_mm = still.p50_mm,
          .flicker_p90_mm = still.p90_mm,
          .moving = moving.part,
          .moving_p50_mm = moving.p50_mm,
          .moving_p90_mm = moving.p90_mm};
}

std::vector<double> vertex_distances_mm(const Mesh& mesh, const Mesh& truth) {
  const NearestTriangle nearest(truth);
  std::vector<double> distances(mesh.vertices.size(), std::numeric_limits<double>::infinity());
  tbb::parallel_for(size_t{0}, distances.size(), [&](size_t v) {
    const auto point = nearest.find(mesh.vertices[v].cast<double>());
    if (point) distances[v] = 1000 * point->distance;
  });
  return distances;
}

}  // namespace v3d
