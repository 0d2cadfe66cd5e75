// Every brick of the surface owns the lattice edges and the cubes that start (have their lowest
// corner) at one of its 512 voxels. Bricks are first looked at 64 voxels at a time, as words of the
// same layout as Brick: which edges are crossed, which cubes hold surface. Counting those bits
// numbers the vertices; then every brick writes its own part of the mesh.
#include "recon/marching_cubes.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <bit>
#include <span>
#include <vector>

#include "recon/cube_cases.h"

namespace v3d {
namespace {

constexpr uint64_t kColumnX0 = 0x0101010101010101;  // voxels with x = 0 in a layer
constexpr uint64_t kRowY0 = 0xFF;                   // voxels with y = 0
constexpr Brick kEmptyBrick{};

/// A brick and those beside, above and behind it: [n] is the one at (n & 1, n >> 1 & 1, n >> 2).
using Neighbourhood = std::array<const Brick*, 8>;

/// What a layer of 64 cubes sees at its corners: word c holds the voxels at corner c
/// (cube_cases.h).
using CornerWords = std::array<uint64_t, 8>;

/// A brick of lattice edges and cubes with surface. Its coordinates begin at -1: the border of the
/// grid is crossed from outside. In the map of such bricks they are one higher.
struct SurfaceBrick {
  BrickCoord at;
  std::array<Brick, 3> crossed;                 ///< [axis]: edges that start at a voxel
  std::array<std::array<uint16_t, 8>, 3> rank;  ///< [axis][z]: crossed edges in the words before
  uint32_t vertex_count = 0;
  uint32_t triangle_count = 0;
  uint32_t first_vertex = 0;
  uint32_t first_triangle = 0;
};

/// Voxels moved by one towards lower x; `beside` fills the gap.
uint64_t shift_x(uint64_t layer, uint64_t beside) {
  return (layer >> 1 & ~(kColumnX0 << 7)) | (beside & kColumnX0) << 7;
}
uint64_t shift_y(uint64_t layer, uint64_t behind) { return layer >> 8 | (behind & kRowY0) << 56; }

/// The four corner words that lie in layer z (0..8) of a neighbourhood.
std::array<uint64_t, 4> layer_corners(const Neighbourhood& bricks, int z) {
  const Brick* const* above = &bricks[z == kBrickEdge ? 4 : 0];
  const auto word = [&](int n) { return (*above[n])[z % kBrickEdge]; };
  const uint64_t here = word(0);
  const uint64_t at_y = shift_y(here, word(2));
  return {here, shift_x(here, word(1)), at_y, shift_x(at_y, shift_y(word(1), word(3)))};
}

CornerWords cube_corners(const Neighbourhood& bricks, int z) {
  const auto low = layer_corners(bricks, z);
  const auto high = layer_corners(bricks, z + 1);
  return {low[0], low[1], low[2], low[3], high[0], high[1], high[2], high[3]};
}

/// Cubes with occupied and empty corners.
uint64_t mixed(const CornerWords& c) {
  const uint64_t any = c[0] | c[1] | c[2] | c[3] | c[4] | c[5] | c[6] | c[7];
  const uint64_t all = c[0] & c[1] & c[2] & c[3] & c[4] & c[5] & c[6] & c[7];
  return any & ~all;
}

unsigned case_of(const CornerWords& corners, int cube) {
  unsigned occupied = 0;
  for (int c = 0; c < 8; ++c) occupied |= static_cast<unsigned>(corners[c] >> cube & 1) << c;
  return occupied;
}

/// The vertices on the edges that a brick of cubes touches. Lattice edges start at 9 x 9 x 9
/// places; those that are not crossed hold anything.
class EdgeVertices {
 public:
  static constexpr int kEdge = kBrickEdge + 1;
  static constexpr int at(int x, int y, int z) { return x + kEdge * (y + kEdge * z); }
  static constexpr int at(int axis, int x, int y, int z) {
    return axis * kEdge * kEdge * kEdge + at(x, y, z);
  }
  uint32_t& operator[](int place) { return vertices_[place]; }

 private:
  std::array<uint32_t, 3 * kEdge * kEdge * kEdge> vertices_;  // NOLINT: not worth filling
};

/// A case as places in EdgeVertices, from that of the cube's lowest corner on.
struct PlacedCase {
  int count = 0;
  std::array<std::array<uint16_t, 3>, kMostCubeTriangles> triangles{};
};

std::array<PlacedCase, 256> place_cases() {
  std::array<PlacedCase, 256> placed;
  for (int occupied = 0; occupied < 256; ++occupied) {
    const CubeCase& shape = cube_cases()[occupied];
    placed[occupied].count = shape.count;
    for (int t = 0; t < shape.count; ++t) {
      for (int tip = 0; tip < 3; ++tip) {
        const CubeEdge e = cube_edge(shape.triangles[t][tip]);
        placed[occupied].triangles[t][tip] =
            static_cast<uint16_t>(EdgeVertices::at(e.axis, e.x, e.y, e.z));
      }
    }
  }
  return placed;
}

/// Calls visit(z, cube, corners) for every cube with surface; `cube` is its bit in layer z.
template <class Visit>
void for_each_cube(const Neighbourhood& bricks, const Visit& visit) {
  for (int z = 0; z < kBrickEdge; ++z) {
    const CornerWords corners = cube_corners(bricks, z);
    for (uint64_t rest = mixed(corners); rest != 0; rest &= rest - 1) {
      visit(z, std::countr_zero(rest), corners);
    }
  }
}

/// Where brick or cube number n of a group of eight lies from the first.
BrickCoord corner(BrickCoord at, int n) {
  return {at.x + (n & 1), at.y + (n >> 1 & 1), at.z + (n >> 2)};
}

BrickCoord in_map(BrickCoord at) { return {at.x + 1, at.y + 1, at.z + 1}; }

/// Beyond its end a row is empty.
uint64_t word_of(std::span<const uint64_t> row, size_t w) { return w < row.size() ? row[w] : 0; }

/// Word w of the bits `row`, moved by one towards higher x.
uint64_t moved_up(std::span<const uint64_t> row, size_t w) {
  const uint64_t carry = w > 0 ? word_of(row, w - 1) >> (BrickMap::kBitsPerWord - 1) : 0;
  return word_of(row, w) << 1 | carry;
}

/// How four rows of bricks cover the places between them.
struct RowsBetween {
  std::array<std::span<const uint64_t>, 4> rows;  ///< empty: outside the grid

  /// Places x of word w with any, or with all, of the bricks x - 1 and x of the four rows.
  uint64_t any(size_t w) const {
    uint64_t bits = 0;
    for (const auto& row : rows) bits |= moved_up(row, w) | word_of(row, w);
    return bits;
  }
  uint64_t all(size_t w) const {
    uint64_t bits = ~uint64_t{0};
    for (const auto& row : rows) bits &= moved_up(row, w) & word_of(row, w);
    return bits;
  }
};

RowsBetween rows_between(const BrickMap& map, int y, int z) {
  RowsBetween between;
  for (int n = 0; n < 4; ++n) {
    const BrickCoord at{0, y - 1 + (n & 1), z - 1 + (n >> 1)};
    if (map.inside(at)) between.rows[n] = map.row(at.y, at.z);
  }
  return between;
}

}  // namespace

/// One surface being made, and the memory of those before.
class MarchingCubes::Surface {
 public:
  void make(const SparseVolume& volume, Mesh& mesh);

 private:
  void place_lattice(const VoxelGrid& grid);
  /// The bricks whose cubes may hold surface.
  void find_bricks();
  void mark_full();
  void examine(SurfaceBrick& brick) const;
  void number();
  void write_vertices(const SurfaceBrick& brick, Mesh& out) const;
  void write_triangles(const SurfaceBrick& brick, Mesh& out) const;

  Neighbourhood neighbourhood(BrickCoord at) const;
  /// The numbers of the vertices on a brick's edges; `n` is its place among its neighbours.
  static void number_edges(const SurfaceBrick& owner, int n, EdgeVertices& vertices);

  const std::array<PlacedCase, 256> cases_ = place_cases();
  const SparseVolume* volume_ = nullptr;
  VoxelGrid lattice_;                            ///< of positions_
  std::array<std::vector<float>, 3> positions_;  ///< of every half voxel along each axis
  BrickMap full_;                                ///< bricks without an empty voxel
  BrickMap map_;                                 ///< in_map() of bricks_
  std::vector<SurfaceBrick> bricks_;
  uint32_t vertex_count_ = 0;
  uint32_t triangle_count_ = 0;
};

void MarchingCubes::Surface::place_lattice(const VoxelGrid& grid) {
  if (grid == lattice_) return;
  lattice_ = grid;
  for (int axis = 0; axis < 3; ++axis) {
    positions_[axis].resize(2 * grid.counts[axis] + 1);
    for (size_t half = 0; half < positions_[axis].size(); ++half) {
      positions_[axis][half] =
          static_cast<float>(grid.origin[axis] + static_cast<double>(half) * grid.voxel_m / 2);
    }
  }
}

void MarchingCubes::Surface::mark_full() {
  full_.clear(volume_->brick_counts());
  for (size_t b = 0; b < volume_->bricks().size(); ++b) {
    const BrickCoord at = volume_->coords()[b];
    if (volume_->bricks()[b] == kFullBrick) full_.word(at) |= BrickMap::bit(at);
  }
}

/// Those that are neither outside (all eight bricks at their corners are empty) nor deep inside
/// (all are full).
void MarchingCubes::Surface::find_bricks() {
  mark_full();
  const std::array<int, 3>& counts = volume_->brick_counts();
  map_.clear({counts[0] + 1, counts[1] + 1, counts[2] + 1});
  bricks_.clear();
  for (int z = 0; z <= counts[2]; ++z) {
    for (int y = 0; y <= counts[1]; ++y) {
      const RowsBetween occupied = rows_between(volume_->occupied(), y, z);
      const RowsBetween full = rows_between(full_, y, z);
      const std::span<uint64_t> row = map_.row(y, z);
      for (size_t w = 0; w < row.size(); ++w) {
        row[w] = occupied.any(w) & ~full.all(w);
        for (uint64_t rest = row[w]; rest != 0; rest &= rest - 1) {
          const int x = static_cast<int>(w) * BrickMap::kBitsPerWord + std::countr_zero(rest);
          bricks_.emplace_back().at = {x - 1, y - 1, z - 1};
        }
      }
    }
  }
  map_.number();
}

Neighbourhood MarchingCubes::Surface::neighbourhood(BrickCoord at) const {
  Neighbourhood bricks;
  for (int n = 0; n < 8; ++n) {
    const int index = volume_->index_of(corner(at, n));
    bricks[n] = index < 0 ? &kEmptyBrick : &volume_->bricks()[index];
  }
  return bricks;
}

void MarchingCubes::Surface::examine(SurfaceBrick& brick) const {
  const Neighbourhood bricks = neighbourhood(brick.at);
  for (int z = 0; z < kBrickEdge; ++z) {
    const CornerWords c = cube_corners(bricks, z);
    brick.crossed[0][z] = c[0] ^ c[1];
    brick.crossed[1][z] = c[0] ^ c[2];
    brick.crossed[2][z] = c[0] ^ c[4];
  }
  for (int axis = 0; axis < 3; ++axis) {
    for (int z = 0; z < kBrickEdge; ++z) {
      brick.rank[axis][z] = static_cast<uint16_t>(brick.vertex_count);
      brick.vertex_count += bit_count(brick.crossed[axis][z]);
    }
  }
  for_each_cube(bricks, [&](int, int cube, const CornerWords& corners) {
    brick.triangle_count += cases_[case_of(corners, cube)].count;
  });
}

void MarchingCubes::Surface::number() {
  vertex_count_ = 0;
  triangle_count_ = 0;
  for (SurfaceBrick& brick : bricks_) {
    brick.first_vertex = vertex_count_;
    brick.first_triangle = triangle_count_;
    vertex_count_ += brick.vertex_count;
    triangle_count_ += brick.triangle_count;
  }
}

void MarchingCubes::Surface::write_vertices(const SurfaceBrick& brick, Mesh& out) const {
  uint32_t vertex = brick.first_vertex;
  for (int axis = 0; axis < 3; ++axis) {
    for (int z = 0; z < kBrickEdge; ++z) {
      for (uint64_t rest = brick.crossed[axis][z]; rest != 0; rest &= rest - 1, ++vertex) {
        const int bit = std::countr_zero(rest);
        // The centre of voxel i lies at 2 i + 1 half voxels.
        std::array<int, 3> half{2 * (kBrickEdge * brick.at.x + bit % kBrickEdge) + 1,
                                2 * (kBrickEdge * brick.at.y + bit / kBrickEdge) + 1,
                                2 * (kBrickEdge * brick.at.z + z) + 1};
        half[axis] += 1;
        for (int a = 0; a < 3; ++a) out.vertices[vertex][a] = positions_[a][half[a]];
      }
    }
  }
}

void MarchingCubes::Surface::number_edges(const SurfaceBrick& owner, int n,
                                          EdgeVertices& vertices) {
  const int dx = kBrickEdge * (n & 1);
  const int dy = kBrickEdge * (n >> 1 & 1);
  const int dz = kBrickEdge * (n >> 2);
  const uint64_t wanted = (dx != 0 ? kColumnX0 : ~uint64_t{0}) & (dy != 0 ? kRowY0 : ~uint64_t{0});
  for (int axis = 0; axis < 3; ++axis) {
    for (int z = 0; z < (dz != 0 ? 1 : kBrickEdge); ++z) {
      const uint64_t crossed = owner.crossed[axis][z];
      const uint32_t first = owner.first_vertex + owner.rank[axis][z];
      for (uint64_t rest = crossed & wanted; rest != 0; rest &= rest - 1) {
        const int bit = std::countr_zero(rest);
        const int place =
            EdgeVertices::at(axis, dx + bit % kBrickEdge, dy + bit / kBrickEdge, dz + z);
        vertices[place] = first + bit_count(crossed & ((uint64_t{1} << bit) - 1));
      }
    }
  }
}

void MarchingCubes::Surface::write_triangles(const SurfaceBrick& brick, Mesh& out) const {
  EdgeVertices vertices;
  for (int n = 0; n < 8; ++n) {
    const int index = map_.index_of(in_map(corner(brick.at, n)));
    if (index >= 0) number_edges(bricks_[index], n, vertices);
  }
  auto* triangle = &out.triangles[brick.first_triangle];
  for_each_cube(neighbourhood(brick.at), [&](int z, int cube, const CornerWords& corners) {
    const PlacedCase& shape = cases_[case_of(corners, cube)];
    const int place = EdgeVertices::at(cube % kBrickEdge, cube / kBrickEdge, z);
    for (int t = 0; t < shape.count; ++t, ++triangle) {
      for (int tip = 0; tip < 3; ++tip) {
        (*triangle)[tip] = vertices[place + shape.triangles[t][tip]];
      }
    }
  });
}

void MarchingCubes::Surface::make(const SparseVolume& volume, Mesh& mesh) {
  volume_ = &volume;
  place_lattice(volume.grid());
  find_bricks();
  tbb::parallel_for(size_t{0}, bricks_.size(), [&](size_t n) { examine(bricks_[n]); });
  number();
  mesh.vertices.resize(vertex_count_);
  mesh.triangles.resize(triangle_count_);
  mesh.colours.clear();
  tbb::parallel_for(size_t{0}, bricks_.size(), [&](size_t n) {
    write_vertices(bricks_[n], mesh);
    if (bricks_[n].triangle_count > 0) write_triangles(bricks_[n], mesh);
  });
}

MarchingCubes::MarchingCubes() : surface_(std::make_unique<Surface>()) {}
MarchingCubes::~MarchingCubes() = default;

void MarchingCubes::run(const SparseVolume& volume, Mesh& mesh) { surface_->make(volume, mesh); }

Mesh marching_cubes(const SparseVolume& volume) {
  Mesh mesh;
  MarchingCubes().run(volume, mesh);
  return mesh;
}

}  // namespace v3d
