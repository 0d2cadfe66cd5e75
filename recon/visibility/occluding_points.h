// What hides a surface from a camera, told by points instead of triangles.
#pragma once

#include <vector>

#include "base/mesh.h"

namespace v3d {

/// The vertices of the mesh, and points inside its larger triangles: no place on the surface is
/// farther than `radius_m` from a point. Where the triangles are no larger than the radius (those
/// of a volume whose voxels have edges of 1.41 * radius_m) these are the vertices alone; a triangle
/// n times as large adds about n^2 / 2 points.
std::vector<Eigen::Vector3f> occluding_points(const Mesh& mesh, double radius_m);

}  // namespace v3d
