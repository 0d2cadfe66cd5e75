// Volume of bricks and its surface.
#pragma once

#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "codec/cube_cases.h"

namespace v3d::codec {

// Brick: 8 x 8 x 8 voxels of a volume, one bit each.

/// Voxel (x, y, z) of the brick is bit 8 * y + x (least significant first) of word z.
using Brick = std::array<uint64_t, 8>;

inline constexpr int kBrickEdge = 8;
inline constexpr uint64_t kFullLayer = ~uint64_t{0};
inline constexpr Brick kEmptyBrick{};
inline constexpr Brick kFullBrick{kFullLayer, kFullLayer, kFullLayer, kFullLayer,
                                  kFullLayer, kFullLayer, kFullLayer, kFullLayer};

// Set of bricks on a lattice, one bit each, with consecutive numbers of the bricks in the set.

/// Brick (x, y, z) holds voxels 8x .. 8x+7, 8y .. 8y+7, 8z .. 8z+7.
struct BrickCoord {
  int x = 0;
  int y = 0;
  int z = 0;
  friend bool operator==(const BrickCoord&, const BrickCoord&) = default;
};

/// Number of set bits. Baseline x86-64 has no instruction for it, and std::popcount() is a function
/// call there.
constexpr int bit_count(uint64_t x) {
  x -= x >> 1 & 0x5555555555555555;
  x = (x & 0x3333333333333333) + (x >> 2 & 0x3333333333333333);
  x = (x + (x >> 4)) & 0x0F0F0F0F0F0F0F0F;
  return static_cast<int>(x * 0x0101010101010101 >> 56);
}

/// A set of bricks. One thread fills it, or several threads that write different rows. Any thread
/// reads it.
class BrickMap {
 public:
  static constexpr int kBitsPerWord = 64;

  /// Empties the set and sets its range to 0 <= x < counts[0] and so on. Keeps its memory.
  void clear(const std::array<int, 3>& counts);

  const std::array<int, 3>& counts() const { return counts_; }
  bool inside(BrickCoord at) const {
    return at.x >= 0 && at.y >= 0 && at.z >= 0 && at.x < counts_[0] && at.y < counts_[1] &&
           at.z < counts_[2];
  }

  /// Brick x is bit x % 64 of word x / 64; bits from counts()[0] on stay 0. Requires a row inside.
  std::span<uint64_t> row(int y, int z) { return {&bits_[word_of({0, y, z})], words_per_row()}; }
  std::span<const uint64_t> row(int y, int z) const {
    return {&bits_[word_of({0, y, z})], words_per_row()};
  }
  /// The word that holds the bit of the brick, for writers that share a row. Requires inside().
  uint64_t& word(BrickCoord at) { return bits_[word_of(at)]; }
  static uint64_t bit(BrickCoord at) { return uint64_t{1} << (at.x % kBitsPerWord); }

  /// Numbers the bricks by z, then y, then x, from 0. Returns their count.
  int number();
  /// The number of the brick; -1 when it is not in the set. Requires number() after the last
  /// change.
  int index_of(BrickCoord at) const {
    if (!inside(at)) return -1;
    const size_t w = word_of(at);
    return (bits_[w] & bit(at)) != 0 ? first_[w] + bit_count(bits_[w] & (bit(at) - 1)) : -1;
  }

 private:
  size_t words_per_row() const { return static_cast<size_t>(words_per_row_); }
  size_t word_of(BrickCoord at) const {
    return (static_cast<size_t>(at.z) * counts_[1] + at.y) * words_per_row_ + at.x / kBitsPerWord;
  }

  std::array<int, 3> counts_{};
  int words_per_row_ = 0;
  std::vector<uint64_t> bits_;
  std::vector<int32_t> first_;  ///< number of the first brick of each word
};

// Discrete marching cubes surface of a volume of bricks, computed brick by brick. The mesher of a
// volume and the decoder of compact frames share it, so that both number vertices and triangles
// identically.
// Source: Kenmochi, Kotani and Imiya, "Marching cubes method with connectivity", ICIP 1999; the
// cases are our own (codec/cube_cases.h).

/// Occupied voxels of a volume; borrowed. bricks[n] is the brick with number n of `occupied`, at
/// coords[n].
struct BrickVolume {
  const BrickMap* occupied = nullptr;
  std::span<const Brick> bricks;
  std::span<const BrickCoord> coords;

  /// The stored brick, else the empty brick.
  const Brick& at(BrickCoord brick) const {
    const int index = occupied->index_of(brick);
    return index < 0 ? kEmptyBrick : bricks[index];
  }
};

/// Position in half voxels from the lowest corner of voxel (0, 0, 0) along each axis. The surface
/// of a voxel at the border of the grid lies on the border, so all numbers are greater than -1.
using HalfVoxels = std::array<int32_t, 3>;

/// A lattice edge: from the centre of `voxel` one voxel along `axis`. Coordinates of `voxel` start
/// at -1.
struct LatticeEdge {
  int axis = 0;
  std::array<int32_t, 3> voxel{};
};

/// The edge whose midpoint is `vertex`. Requires that exactly one coordinate of `vertex` is even.
LatticeEdge edge_at(const HalfVoxels& vertex);

/// Surface of a volume. Call in this order: begin(); examine() for every brick; number(); then the
/// write functions for every brick.
///
/// Different threads may examine and write different bricks. The volume must stay valid from
/// begin() until the last brick is written; vertex_on() does not need it. Keeps its memory.
class BrickSurface {
 public:
  using Triangle = std::array<uint32_t, 3>;

  /// A brick of the surface. It owns the lattice edges and the cubes that start (have their lowest
  /// corner) at one of its 512 voxels.
  struct SurfaceBrick {
    BrickCoord at;                 ///< coordinates start at -1, outside the border of the grid
    std::array<Brick, 3> crossed;  ///< [axis]: edges with a vertex, by the voxel where they start
    std::array<std::array<uint16_t, 8>, 3> rank;  ///< [axis][z]: crossed edges in earlier words
    uint32_t vertex_count = 0;
    uint32_t triangle_count = 0;
    uint32_t first_vertex = 0;
    uint32_t first_triangle = 0;
  };

  BrickSurface();

  /// Finds the bricks whose cubes may contain surface. It skips bricks outside (all eight bricks at
  /// their corners are empty) and deep inside (all eight are full).
  void begin(const BrickVolume& volume);
  /// Finds the crossed edges of a brick and counts its vertices and triangles.
  void examine(size_t brick);
  /// Numbers vertices and triangles of all bricks. Requires that every brick is examined.
  void number();

  /// Bricks of the surface, ordered by z, then y, then x.
  std::span<const SurfaceBrick> bricks() const { return bricks_; }
  uint32_t vertex_count() const { return vertex_count_; }
  uint32_t triangle_count() const { return triangle_count_; }

  /// Calls visit(vertex, HalfVoxels) in order for the vertices that the brick owns.
  template <class Visit>
  void for_each_vertex(size_t brick, const Visit& visit) const;
  /// Writes the triangles of the brick into `triangles`, the array of all triangles. They are
  /// counter-clockwise seen from the empty side.
  void write_triangles(size_t brick, std::span<Triangle> triangles) const;

  /// The number of the vertex on an edge; -1 when the edge is not crossed.
  int64_t vertex_on(const LatticeEdge& edge) const;

 private:
  /// A brick and its upper neighbours: [n] is the one at (n & 1, n >> 1 & 1, n >> 2).
  using Neighbourhood = std::array<const Brick*, 8>;
  class EdgeVertices;

  /// A case as indices into EdgeVertices, relative to the lowest corner of the cube.
  struct PlacedCase {
    int count = 0;
    std::array<std::array<uint16_t, 3>, kMaxCubeTriangles> triangles{};
  };

  static std::array<PlacedCase, 256> place_cases();
  static void number_edges(const SurfaceBrick& owner, int n, EdgeVertices& vertices);
  void mark_full();
  Neighbourhood neighbourhood(BrickCoord at) const;

  std::array<PlacedCase, 256> cases_ = place_cases();
  BrickVolume volume_;
  BrickMap full_;  ///< completely occupied bricks
  BrickMap map_;   ///< coordinates of bricks_, plus one
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
      for (uint64_t remaining = owner.crossed[axis][z]; remaining != 0;
           remaining &= remaining - 1, ++vertex) {
        const int bit = std::countr_zero(remaining);
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

}  // namespace v3d::codec
