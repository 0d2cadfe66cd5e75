#include "recon/metrics/surface_samples.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <iterator>
#include <random>

namespace v3d {
namespace {

/// Cumulative area of the triangles, by triangle.
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

}  // namespace

Eigen::Vector3d interpolated(const Mesh& mesh, const std::vector<Eigen::Vector3f>& values,
                             uint32_t triangle, const Eigen::Vector3d& weights) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (int k = 0; k < 3; ++k) {
    sum += weights[k] * values[mesh.triangles[triangle][k]].cast<double>();
  }
  return sum;
}

// The C++ standard does not define the results of its distributions, only those of the engine. So
// the distributions are computed here.
std::vector<SurfaceSample> sample_surface(const Mesh& mesh, int samples, uint64_t seed) {
  std::vector<SurfaceSample> spread;
  const std::vector<double> area = cumulative_area(mesh);
  if (area.empty() || !(area.back() > 0)) {
    return spread;
  }
  const std::vector<Eigen::Vector3f> normals = vertex_normals(mesh);
  std::mt19937_64 engine(seed);
  const auto uniform = [&] { return static_cast<double>(engine() >> 11) * 0x1p-53; };
  spread.reserve(samples);
  for (int i = 0; i < samples; ++i) {
    const double target = (i + uniform()) / samples * area.back();
    const auto found = std::upper_bound(area.begin(), area.end(), target);
    const auto t =
        static_cast<uint32_t>(std::min<ptrdiff_t>(found - area.begin(), std::ssize(area) - 1));
    const double r = std::sqrt(uniform()), s = uniform();
    const Eigen::Vector3d weights(1 - r, r * (1 - s), r * s);
    spread.push_back({interpolated(mesh, mesh.vertices, t, weights),
                      interpolated(mesh, normals, t, weights).normalized()});
  }
  return spread;
}

}  // namespace v3d
