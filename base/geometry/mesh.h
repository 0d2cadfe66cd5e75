// Coloured triangle mesh and its basic properties.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <vector>

namespace v3d {

struct Rgb8 {
  uint8_t r = 0, g = 0, b = 0;
  friend bool operator==(const Rgb8&, const Rgb8&) = default;
};

struct Mesh {
  std::vector<Eigen::Vector3f> vertices;           ///< world, metres
  std::vector<std::array<uint32_t, 3>> triangles;  ///< counter-clockwise seen from outside
  std::vector<Rgb8> colours;                       ///< one per vertex, or empty
};

/// Area-weighted outward unit normals, one per vertex; zero for a vertex without area.
std::vector<Eigen::Vector3f> vertex_normals(const Mesh& mesh);

/// Signed volume in cubic metres (divergence theorem); positive for a closed mesh with outward
/// triangles.
double enclosed_volume(const Mesh& mesh);

/// True when exactly two triangles share each edge, in opposite directions.
bool is_watertight(const Mesh& mesh);

/// True when the mesh is watertight and the triangles around each vertex form a single fan.
bool is_manifold(const Mesh& mesh);

/// The number of connected components (triangles that share vertices).
int connected_components(const Mesh& mesh);

}  // namespace v3d
