#include "recon/evaluation.h"

#include <tbb/parallel_for.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <random>
#include <vector>

#include "recon/nearest_triangle.h"

namespace v3d {
namespace {

struct Sample {
  Eigen::Vector3d position;
  Eigen::Vector3d normal;
};

Eigen::Vector3d interpolated(const Mesh& mesh, const std::vector<Eigen::Vector3f>& values,
                             uint32_t triangle, const Eigen::Vector3d& weights) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (int k = 0; k < 3; ++k) {
    sum += weights[k] * values[mesh.triangles[triangle][k]].cast<double>();
  }
  return sum;
}

/// Area up to and including each triangle.
std::vector<double> cumulative_area(const Mesh& mesh) {
  std::vector<double> area(mesh.triangles.size());
  double sum = 0;
  for (size_t t = 0; t < area.size(); ++t) {
    const auto& [a, b, c] = mesh.triangles[t];
    const Eigen::Vector3d ab = (mesh.vertices[b] - mesh.vertices[a]).cast<double>();
    const Eigen::Vector3d ac = (mesh.vertices[c] - mesh.vertices[a]).cast<double>();
    sum += 0.5 * ab.cross(ac).norm();
    area[t] = sum;
  }
  return area;
}

/// Evenly spread by area. The standard fixes the engine's numbers, not those of its distributions:
/// so the distributions are made here, and are the same everywhere.
std::vector<Sample> sample_surface(const Mesh& mesh, const SurfaceDistanceOptions& options) {
  std::vector<Sample> samples;
  const std::vector<double> area = cumulative_area(mesh);
  if (area.empty() || !(area.back() > 0)) {
    return samples;
  }
  const std::vector<Eigen::Vector3f> normals = vertex_normals(mesh);
  std::mt19937_64 engine(options.seed);
  const auto uniform = [&] { return static_cast<double>(engine() >> 11) * 0x1p-53; };
  samples.reserve(options.samples);
  for (int i = 0; i < options.samples; ++i) {
    const double target = (i + uniform()) / options.samples * area.back();
    const auto found = std::upper_bound(area.begin(), area.end(), target);
    const auto t =
        static_cast<uint32_t>(std::min<ptrdiff_t>(found - area.begin(), std::ssize(area) - 1));
    const double r = std::sqrt(uniform()), s = uniform();
    const Eigen::Vector3d weights(1 - r, r * (1 - s), r * s);
    samples.push_back({interpolated(mesh, mesh.vertices, t, weights),
                       interpolated(mesh, normals, t, weights).normalized()});
  }
  return samples;
}

struct Comparison {
  std::vector<double> distance_m;  ///< one per sample
  double mean_angle_deg = 0;
};

double angle_deg(const Eigen::Vector3d& a, const Eigen::Vector3d& b) {
  return std::atan2(a.cross(b).norm(), a.dot(b)) * 180 / std::numbers::pi;
}

Comparison compare(const std::vector<Sample>& samples, const Mesh& other) {
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

/// Nearest rank; reorders `values`.
double percentile(std::vector<double>& values, double part) {
  const auto rank = static_cast<size_t>(std::ceil(part * static_cast<double>(values.size())));
  const auto nth = values.begin() + static_cast<ptrdiff_t>(std::max<size_t>(rank, 1) - 1);
  std::nth_element(values.begin(), nth, values.end());
  return *nth;
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

SurfaceDistance without_surface(bool both) {
  if (both) {
    return {.f_score_2mm = 1, .f_score_5mm = 1, .f_score_10mm = 1};
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
  const std::vector<Sample> from_result = sample_surface(reconstructed, options);
  const std::vector<Sample> from_truth = sample_surface(truth, options);
  if (from_result.empty() || from_truth.empty()) {
    return without_surface(from_result.empty() && from_truth.empty());
  }
  Comparison accuracy = compare(from_result, truth);
  Comparison completeness = compare(from_truth, reconstructed);
  SurfaceDistance d;
  d.f_score_2mm = f_score(accuracy, completeness, 0.002);
  d.f_score_5mm = f_score(accuracy, completeness, 0.005);
  d.f_score_10mm = f_score(accuracy, completeness, 0.010);
  d.accuracy_p50_mm = 1000 * percentile(accuracy.distance_m, 0.5);
  d.accuracy_p90_mm = 1000 * percentile(accuracy.distance_m, 0.9);
  d.completeness_p50_mm = 1000 * percentile(completeness.distance_m, 0.5);
  d.completeness_p90_mm = 1000 * percentile(completeness.distance_m, 0.9);
  d.normal_error_deg = accuracy.mean_angle_deg;
  return d;
}

}  // namespace v3d
