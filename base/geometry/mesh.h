// Mesh and the lattice of its vertices.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cmath>
#include <cstdint>
#include <vector>

namespace v3d {

// Coloured triangle mesh and its basic properties.

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

/// The triangles of the connected component with the most triangles; the first of several. Keeps
/// all vertices and colours.
Mesh largest_component(const Mesh& mesh);

// The lattice to which vertices of a compact frame are quantised.

/// Positions float(origin + h * step) per axis, with an integer h.
struct VertexLattice {
  Eigen::Vector3d origin = Eigen::Vector3d::Zero();  ///< world, metres
  double step = 0;                                   ///< metres
  friend bool operator==(const VertexLattice&, const VertexLattice&) = default;
};

/// The nearest lattice point. Receivers of a compact frame decode the same bits.
inline Eigen::Vector3f rounded_to(const VertexLattice& lattice, const Eigen::Vector3f& position) {
  Eigen::Vector3f rounded;
  for (int axis = 0; axis < 3; ++axis) {
    const double h =
        std::floor((double{position[axis]} - lattice.origin[axis]) / lattice.step + 0.5);
    rounded[axis] = static_cast<float>(lattice.origin[axis] + h * lattice.step);
  }
  return rounded;
}

}  // namespace v3d
