// The surface of a volume of bricks, brick by brick: the discrete marching cubes that make a mesh
// of a volume and the decoder that makes the same mesh of a compact frame share it, so that both
// number vertices and triangles alike.
// Source: Kenmochi, Kotani and Imiya, "Marching cubes method with connectivity", ICIP 1999; the
// cases are our own (codec/cube_cases.h).
#pragma once

#include <array>
#include <bit>
#include <cstdint>
#include <span>
#include <vector>

#include "codec/brick.h"
#include "codec/brick_map.h"
#include "codec/cube_cases.h"

namespace v3d {

/// Occupied voxels; borrowed. bricks[n] is the brick with number n of `occupied`, at coords[n].
struct BrickVolume {
  const BrickMap* occupied = nullptr;
  std::span<const Brick> bricks;
  std::span<const BrickCoord> coords;

  /// The empty brick where none is stored.
  const Brick& at(BrickCoord brick) const {
    const int index = occupied->index_of(brick);
    return index < 0 ? kEmptyBrick : bricks[index];
  }
};

/// Half voxels from the lowest corner of voxel (0, 0, 0) along each axis; -1 is not reached: the
/// surface of a voxel at the border of the grid lies on the border.
using HalfVoxels = std::array<int32_t, 3>;

/// A lattice edge from the centre of `voxel` one voxel along `axis`. `voxel` begins at -1.
struct LatticeEdge {
  int axis = 0;
  std::array<int32_t, 3> voxel{};
};

/// The edge that a vertex is the middle of: exactly one of its numbers is even.
LatticeEdge edge_at(const HalfVoxels& vertex);

/// Works in steps: begin(); examine() every brick; number(); then write every brick. Bricks may be
/// examined and written on different threads. A volume's surface needs its volume from begin() on
/// until the last brick is written; vertex_on() does not. Keeps its memory.
class BrickSurface {
 public:
  using Triangle = std::array<uint32_t, 3>;

  /// Every brick of the surface owns the lattice edges and the cubes that start (have their lowest
  /// corner) at one of its 512 voxels.
  struct SurfaceBrick {
    BrickCoord at;                 ///< begins at -1: the border is crossed from outside
    std::array<Brick, 3> crossed;  ///< [axis]: edges that start at a voxel
    std::array<std::array<uint16_t, 8>, 3> rank;  ///< [axis][z]: crossed edges in the words before
    uint32_t vertex_count = 0;
    uint32_t triangle_count = 0;
    uint32_t first_vertex = 0;
    uint32_t first_triangle = 0;
  };

  BrickSurface();

  /// Finds the bricks whose cubes may hold surface: those that are neither outside (all eight
  /// bricks at their corners are empty) nor deep inside (all are full).
  void begin(const BrickVolume& volume);
  void examine(size_t brick);
  void number();

  /// In the order of their numbers: by z, then y, then x.
  std::span<const SurfaceBrick> bricks() const { return bricks_; }
  uint32_t vertex_count() const { return vertex_count_; }
  uint32_t triangle_count() const { return triangle_count_; }

  /// Calls visit(vertex, HalfVoxels) for the vertices that the brick owns, in their order.
  template <class Visit>
  void for_each_vertex(size_t brick, const Visit& visit) const;
  /// Writes the brick's part of all triangles, counter-clockwise seen from the empty side.
  void write_triangles(size_t brick, std::span<Triangle> triangles) const;

  /// The vertex on an edge, -1 where the edge is not crossed.
  int64_t vertex_on(const LatticeEdge& edge) const;

 private:
  /// A brick and those beside, above and behind it: [n] is the one at (n & 1, n >> 1 & 1, n >> 2).
  using Neighbourhood = std::array<const Brick*, 8>;
  class EdgeVertices;

  /// A case as places in EdgeVertices, from that of the cube's lowest corner on.
  struct PlacedCase {
    int count = 0;
    std::array<std::array<uint16_t, 3>, kMostCubeTriangles> triangles{};
  };

  static std::array<PlacedCase, 256> place_cases();
  static void number_edges(const SurfaceBrick& owner, int n, EdgeVertices& vertices);
  void mark_full();
  Neighbourhood neighbourhood(BrickCoord at) const;

  std::array<PlacedCase, 256> cases_ = place_cases();
  BrickVolume volume_;
  BrickMap full_;  ///< bricks without an empty voxel
  BrickMap map_;   ///< of bricks_, their coordinates one higher
  std::vector<SurfaceBrick> bricks_;
  uint32_t vertex_count_ = 0;
  uint32_t triangle_count_ = 0;
};

template <class Visit>
void BrickSurface::for_each_vertex(size_t brick, const Visit& visit) const {
  const SurfaceBrick& owner = bricks_[brick];
  uint32_t vertex = owner.first_vertex;
  for (int axis = 0; axis < 3; ++axis) {
    for (int z = 0; z < kBrickEdge; ++z) {
      for (uint64_t rest = owner.crossed[axis][z]; rest != 0; rest &= rest - 1, ++vertex) {
        const int bit = std::countr_zero(rest);
        // The centre of voxel i lies at 2 i + 1 half voxels.
        HalfVoxels half{2 * (kBrickEdge * owner.at.x + bit % kBrickEdge) + 1,
                        2 * (kBrickEdge * owner.at.y + bit / kBrickEdge) + 1,
                        2 * (kBrickEdge * owner.at.z + z) + 1};
        half[axis] += 1;
        visit(vertex, half);
      }
    }
  }
}

}  // namespace v3d
