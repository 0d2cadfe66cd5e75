// Vertex visibility: tests which vertices of a block a camera sees. Step 1 of the deformation
// (section 2.3 of the paper).
#pragma once

#include <Eigen/Core>
#include <array>
#include <bit>
#include <span>
#include <vector>

#include "recon/visibility/depth_buffer.h"
#include "recon/visibility/point_depth_buffer.h"
#include "recon/visibility/surface_camera.h"

namespace v3d::recon {

/// Points in the world, metres, one array per coordinate.
struct PointBlock {
  static constexpr size_t kCapacity = 384;
  size_t count = 0;
  alignas(64) std::array<float, kCapacity> x{}, y{}, z{};

  void set(size_t i, const Eigen::Vector3f& position) {
    x[i] = position.x(), y[i] = position.y(), z[i] = position.z();
  }
};

/// Projections of a PointBlock: equal to SurfaceCamera::project() of each point, to the bit. NaN
/// where a point has no projection.
struct PixelBlock {
  alignas(64) std::array<float, PointBlock::kCapacity> u, v, z;
};
void project_block(const SurfaceCamera& camera, const PointBlock& points, PixelBlock& pixels);

struct VisibilityOptions {
  float min_facing = 0.3F;  ///< smallest cosine between normal and direction to the camera
  float tolerance_m = 0;    ///< see SurfaceCamera::sees(); grows with the slant
};

/// A block of vertices in one camera.
struct VertexVisibility {
  static constexpr size_t kCapacity = 128;  ///< vertices; blocks of 15 cameras fit into a cache
  alignas(64) std::array<float, kCapacity> u, v, z;  ///< as in PixelBlock
  alignas(64) std::array<float, kCapacity> facing;   ///< cosine, also of hidden vertices
  alignas(64)
      std::array<float, kCapacity> seen;  ///< `facing` where the camera sees the vertex, else -2

  SurfaceCamera::Seen at(size_t i) const { return {{u[i], v[i]}, z[i]}; }
};

/// Projects the vertices and tests each against `depth`, the depth buffer of the mesh. `normals`
/// have unit length. Requires at most kCapacity vertices. Vectorised by run-time dispatch; every
/// instruction set gives the same bits.
void test_visibility(const SurfaceCamera& camera, const DepthBuffer& depth,
                     const PointBlock& positions, const PointBlock& normals,
                     const VisibilityOptions& options, VertexVisibility& visibility);

/// One bit per vertex of a block.
using VertexBits = std::array<uint64_t, VertexVisibility::kCapacity / 64>;

/// Calls work(vertex) for each set bit, ascending.
template <class Work>
void for_each_bit(const VertexBits& bits, const Work& work) {
  for (size_t word = 0; word < bits.size(); ++word) {
    for (uint64_t rest = bits[word]; rest != 0; rest &= rest - 1) {
      work(64 * word + static_cast<size_t>(std::countr_zero(rest)));
    }
  }
}

/// One bit for each of the first `count` vertices: set where the absolute cosine of `facing` is at
/// most `max_facing`, and the vertex projects to one of `pixels`.
VertexBits grazing_vertices(const Mask& pixels, const VertexVisibility& visibility, size_t count,
                            float max_facing);

/// Like test_visibility(), with the point depth buffer of the mesh in `camera`. Cells are wider
/// than pixels, so the tolerance grows with the slant across a cell. A vertex outside the valid
/// cells is not seen; a default-constructed buffer has none.
void test_cell_visibility(const SurfaceCamera& camera, const PointDepthBuffer& depth,
                          const PointBlock& positions, const PointBlock& normals,
                          const VisibilityOptions& options, VertexVisibility& visibility);

}  // namespace v3d::recon
