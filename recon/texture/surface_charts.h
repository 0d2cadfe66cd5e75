// Charts of a surface: parts that fit into a plane without overlap.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "base/geometry/mesh.h"

namespace v3d::recon {

/// A part of a surface and the plane of its orthographic projection.
struct Chart {
  std::vector<uint32_t> triangles;  ///< of the mesh, ascending; not empty
  /// A few triangles inside the chart that its projection turns over or hides, as in small folds.
  std::vector<uint32_t> folded;
  /// Axes of the plane: perpendicular unit vectors, world. `right` x `up` points out of the
  /// surface.
  Eigen::Vector3f right{1, 0, 0}, up{0, 1, 0};
};

/// Divides the surface into connected charts. Every triangle is in one of them.
///
/// Each triangle prefers the nearest of 14 directions (axes and space diagonals) to the smoothed
/// normal of the surface; neighbours prefer the same one. Small parts join a neighbour. Triangles
/// that a projection would turn over or hide behind others get charts of their own, so the
/// projection of `triangles` is one to one down to `cell_m` metres (0: a third of the mean edge).
/// Only folds of a few triangles stay as `folded`: charts of their own would need many texels for
/// parts that hardly any camera sees. The axes give a chart a small bounding rectangle.
/// Deterministic. One thread.
std::vector<Chart> surface_charts(const Mesh& mesh, double cell_m = 0);

}  // namespace v3d::recon
