// Closed surfaces from the triangles of a model: welded seams, connected surfaces, closed holes.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <span>
#include <vector>

namespace v3d::sim {

/// A connected surface. Its vertices are those of `sources`, then one for each hole: the mean of
/// the vertices around the hole.
struct ClosedSurface {
  std::vector<uint32_t> sources;                   ///< indices of the given vertices
  std::vector<std::vector<uint32_t>> holes;        ///< by hole its vertices, indices of `sources`
  std::vector<std::array<uint32_t, 3>> triangles;  ///< indices of the vertices of this surface

  /// Appends the mean of the values around each hole to the values of `sources`.
  void add_middles(std::vector<Eigen::Vector3f>& values) const;
};

/// The connected surfaces of triangles. Vertices at equal positions count as one: the first of
/// them. Triangles that have a vertex twice are left out. For every directed edge of a surface
/// there is an opposite one, because triangles to its middle close a hole.
std::vector<ClosedSurface> closed_surfaces(std::span<const Eigen::Vector3f> positions,
                                           std::span<const std::array<uint32_t, 3>> triangles);

}  // namespace v3d::sim
