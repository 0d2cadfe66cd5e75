#include "recon/visibility/surface_points.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>

namespace v3d {
namespace {

using Corners = std::array<Eigen::Vector3f, 3>;

/// Squared covering radius: the largest distance of a place in the triangle from the nearest
/// corner. It is half the longest edge in obtuse triangles, else the circumradius.
float covering_radius2(const Corners& c) {
  const Eigen::Vector3f ab = c[1] - c[0], ac = c[2] - c[0];
  std::array<float, 3> edge2{ab.squaredNorm(), ac.squaredNorm(), (ac - ab).squaredNorm()};
  std::sort(edge2.begin(), edge2.end());
  const float area2 = ab.cross(ac).squaredNorm();  // of the parallelogram
  const bool obtuse = edge2[0] + edge2[1] <= edge2[2];
  return obtuse || area2 == 0 ? edge2[2] / 4 : edge2[0] * edge2[1] * edge2[2] / (4 * area2);
}

/// A cheap sufficient test: true only when the covering radius is at most `radius`. True for most
/// triangles.
bool surely_small(const Corners& c, float radius2) {
  const float longest2 = std::max(
      {(c[1] - c[0]).squaredNorm(), (c[2] - c[0]).squaredNorm(), (c[2] - c[1]).squaredNorm()});
  return longest2 <= 3 * radius2;
}

/// The corners of the n * n similar triangles into which a triangle is divided, without its own
/// corners.
void add_lattice(const Corners& c, int n, std::vector<Eigen::Vector3f>& points) {
  const Eigen::Vector3f ab = (c[1] - c[0]) / static_cast<float>(n);
  const Eigen::Vector3f ac = (c[2] - c[0]) / static_cast<float>(n);
  for (int i = 0; i <= n; ++i) {
    for (int j = 0; i + j <= n; ++j) {
      const bool corner = i == n || j == n || (i == 0 && j == 0);
      if (!corner) {
        points.push_back(c[0] + static_cast<float>(i) * ab + static_cast<float>(j) * ac);
      }
    }
  }
}

}  // namespace

std::vector<Eigen::Vector3f> occluding_points(const Mesh& mesh, double radius_m) {
  std::vector<Eigen::Vector3f> points = mesh.vertices;
  const auto radius2 = static_cast<float>(radius_m * radius_m);
  for (const auto& t : mesh.triangles) {
    const Corners corners{mesh.vertices[t[0]], mesh.vertices[t[1]], mesh.vertices[t[2]]};
    if (surely_small(corners, radius2)) {
      continue;
    }
    const float cover2 = covering_radius2(corners);
    if (cover2 > radius2) {
      add_lattice(corners, static_cast<int>(std::ceil(std::sqrt(cover2) / radius_m)), points);
    }
  }
  return points;
}

}  // namespace v3d
