#include "sim/performer/surface_points.h"

#include <algorithm>
#include <cmath>

#include "base/core/error.h"
#include "sim/rendering/noise.h"

namespace v3d::sim {
namespace {

PointGroup group_of(const Part& part) {
  switch (part.material) {
    case Material::kBlade:
    case Material::kHandle:
    case Material::kGuard:
      return PointGroup::kSword;
    default:
      return part.is_sleeve ? PointGroup::kSleeve : PointGroup::kOther;
  }
}

double area_of(const Mesh& mesh, const std::array<uint32_t, 3>& t) {
  const Eigen::Vector3d a = mesh.vertices[t[0]].cast<double>();
  return 0.5 * (mesh.vertices[t[1]].cast<double>() - a)
                   .cross(mesh.vertices[t[2]].cast<double>() - a)
                   .norm();
}

}  // namespace

SurfacePoints::SurfacePoints(const std::vector<Part>& parts, size_t count, uint64_t seed) {
  std::vector<double> until;  // area of all triangles up to each
  std::vector<Point> triangles;
  for (uint32_t p = 0; p < parts.size(); ++p) {
    for (uint32_t t = 0; t < parts[p].mesh.triangles.size(); ++t) {
      const double before = until.empty() ? 0 : until.back();
      until.push_back(before + area_of(parts[p].mesh, parts[p].mesh.triangles[t]));
      triangles.push_back({p, t, Eigen::Vector3f::Zero()});
    }
  }
  if (until.empty() || until.back() <= 0) return;
  for (uint64_t i = 0; i < count; ++i) {
    const double area = uniform(seed, 3 * i, 0, until.back());
    const auto at = std::upper_bound(until.begin(), until.end() - 1, area) - until.begin();
    Point point = triangles[static_cast<size_t>(at)];
    // Evenly in a triangle.
    const double root = std::sqrt(uniform(seed, 3 * i + 1, 0, 1));
    const double along = uniform(seed, 3 * i + 2, 0, 1);
    point.weights = Eigen::Vector3d(1 - root, root * (1 - along), root * along).cast<float>();
    points_.push_back(point);
    groups_.push_back(group_of(parts[point.part]));
  }
}

std::vector<Eigen::Vector3f> SurfacePoints::positions(const std::vector<Part>& parts) const {
  std::vector<Eigen::Vector3f> positions;
  for (const Point& point : points_) {
    V3D_CHECK(point.part < parts.size());
    const Mesh& mesh = parts[point.part].mesh;
    const auto& [a, b, c] = mesh.triangles[point.triangle];
    positions.push_back(point.weights[0] * mesh.vertices[a] + point.weights[1] * mesh.vertices[b] +
                        point.weights[2] * mesh.vertices[c]);
  }
  return positions;
}

std::vector<Eigen::Vector3f> SurfacePoints::normals(const std::vector<Part>& parts) const {
  std::vector<Eigen::Vector3f> normals;
  for (const Point& point : points_) {
    V3D_CHECK(point.part < parts.size());
    const Mesh& mesh = parts[point.part].mesh;
    const auto& [a, b, c] = mesh.triangles[point.triangle];
    normals.push_back((mesh.vertices[b] - mesh.vertices[a])
                          .cross(mesh.vertices[c] - mesh.vertices[a])
                          .normalized());
  }
  return normals;
}

}  // namespace v3d::sim
