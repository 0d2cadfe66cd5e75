#include "codec/bricks.h"

namespace v3d::codec {

void BrickMap::clear(const std::array<int, 3>& counts) {
  counts_ = counts;
  words_per_row_ = (counts[0] + kBitsPerWord - 1) / kBitsPerWord;
  bits_.assign(words_per_row() * counts[1] * counts[2], 0);
}

int BrickMap::number() {
  first_.resize(bits_.size());
  int32_t count = 0;
  for (size_t w = 0; w < bits_.size(); ++w) {
    first_[w] = count;
    count += bit_count(bits_[w]);
  }
  return count;
}

// Bricks are processed 64 voxels at a time, as words of the same layout as Brick. First the crossed
// edges and the cubes with surface are found. Counting these bits numbers the vertices; then every
// brick writes its own part of the mesh.

namespace {

constexpr uint64_t kColumnX0 = 0x0101010101010101;  // voxels with x = 0 in a layer
constexpr uint64_t kRowY0 = 0xFF;                   // voxels with y = 0

/// A brick and its upper neighbours: [n] is the one at (n & 1, n >> 1 & 1, n >> 2).
using Neighbourhood = std::array<const Brick*, 8>;

/// Voxels at the corners of a layer of 64 cubes: word c holds those at corner c (cube_cases.h).
using CornerWords = std::array<uint64_t, 8>;

/// Shifts voxels by one towards lower x; `beside` fills the gap.
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

/// Mask of the cubes with both occupied and empty corners.
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

/// Calls visit(z, cube, corners) for every cube with surface; `cube` is its bit in layer z.
template <class Visit>
void for_each_cube(const Neighbourhood& bricks, const Visit& visit) {
  for (int z = 0; z < kBrickEdge; ++z) {
    const CornerWords corners = cube_corners(bricks, z);
    for (uint64_t remaining = mixed(corners); remaining != 0; remaining &= remaining - 1) {
      visit(z, std::countr_zero(remaining), corners);
    }
  }
}

/// Position of brick or cube number n of a group of eight whose first is at `at`.
BrickCoord corner(BrickCoord at, int n) {
  return {at.x + (n & 1), at.y + (n >> 1 & 1), at.z + (n >> 2)};
}

BrickCoord in_map(BrickCoord at) { return {at.x + 1, at.y + 1, at.z + 1}; }

/// Word w of a row; 0 after its end.
uint64_t word_of(std::span<const uint64_t> row, size_t w) { return w < row.size() ? row[w] : 0; }

/// Word w of `row` shifted by one towards higher x.
uint64_t moved_up(std::span<const uint64_t> row, size_t w) {
  const uint64_t carry = w > 0 ? word_of(row, w - 1) >> (BrickMap::kBitsPerWord - 1) : 0;
  return word_of(row, w) << 1 | carry;
}

/// Four rows of bricks around the lattice positions between them.
struct RowsBetween {
  std::array<std::span<const uint64_t>, 4> rows;  ///< empty: outside the grid

  /// Positions x of word w where any, or all, of the bricks x - 1 and x of the four rows are set.
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

LatticeEdge edge_at(const HalfVoxels& vertex) {
  LatticeEdge edge;
  for (int axis = 0; axis < 3; ++axis) {
    const bool along = vertex[axis] % 2 == 0;
    if (along) edge.axis = axis;
    edge.voxel[axis] = (vertex[axis] - (along ? 2 : 1)) / 2;
  }
  return edge;
}

/// Numbers of the vertices on the edges of a brick of cubes. Lattice edges start at 9 x 9 x 9
/// positions; entries of edges that are not crossed are undefined.
class BrickSurface::EdgeVertices {
 public:
  static constexpr int kEdge = kBrickEdge + 1;
  static constexpr int at(int x, int y, int z) { return x + kEdge * (y + kEdge * z); }
  static constexpr int at(int axis, int x, int y, int z) {
    return axis * kEdge * kEdge * kEdge + at(x, y, z);
  }
  uint32_t& operator[](int place) { return vertices_[place]; }

 private:
  std::array<uint32_t, 3 * kEdge * kEdge * kEdge> vertices_;  // NOLINT: uninitialised for speed
};

std::array<BrickSurface::PlacedCase, 256> BrickSurface::place_cases() {
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

BrickSurface::BrickSurface() = default;

void BrickSurface::mark_full() {
  full_.clear(volume_.occupied->counts());
  for (size_t b = 0; b < volume_.bricks.size(); ++b) {
    const BrickCoord at = volume_.coords[b];
    if (volume_.bricks[b] == kFullBrick) full_.word(at) |= BrickMap::bit(at);
  }
}

void BrickSurface::begin(const BrickVolume& volume) {
  volume_ = volume;
  mark_full();
  const std::array<int, 3>& counts = volume_.occupied->counts();
  map_.clear({counts[0] + 1, counts[1] + 1, counts[2] + 1});
  bricks_.clear();
  for (int z = 0; z <= counts[2]; ++z) {
    for (int y = 0; y <= counts[1]; ++y) {
      const RowsBetween occupied = rows_between(*volume_.occupied, y, z);
      const RowsBetween full = rows_between(full_, y, z);
      const std::span<uint64_t> row = map_.row(y, z);
      for (size_t w = 0; w < row.size(); ++w) {
        row[w] = occupied.any(w) & ~full.all(w);
        for (uint64_t remaining = row[w]; remaining != 0; remaining &= remaining - 1) {
          const int x = static_cast<int>(w) * BrickMap::kBitsPerWord + std::countr_zero(remaining);
          bricks_.emplace_back().at = {x - 1, y - 1, z - 1};
        }
      }
    }
  }
  map_.number();
}

BrickSurface::Neighbourhood BrickSurface::neighbourhood(BrickCoord at) const {
  Neighbourhood bricks;
  for (int n = 0; n < 8; ++n) bricks[n] = &volume_.at(corner(at, n));
  return bricks;
}

void BrickSurface::examine(size_t n) {
  SurfaceBrick& brick = bricks_[n];
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

void BrickSurface::number() {
  vertex_count_ = 0;
  triangle_count_ = 0;
  for (SurfaceBrick& brick : bricks_) {
    brick.first_vertex = vertex_count_;
    brick.first_triangle = triangle_count_;
    vertex_count_ += brick.vertex_count;
    triangle_count_ += brick.triangle_count;
  }
}

/// Writes the vertex numbers of the edges of brick `owner`; `n` is its position in the
/// neighbourhood.
void BrickSurface::number_edges(const SurfaceBrick& owner, int n, EdgeVertices& vertices) {
  const int dx = kBrickEdge * (n & 1);
  const int dy = kBrickEdge * (n >> 1 & 1);
  const int dz = kBrickEdge * (n >> 2);
  const uint64_t wanted = (dx != 0 ? kColumnX0 : ~uint64_t{0}) & (dy != 0 ? kRowY0 : ~uint64_t{0});
  for (int axis = 0; axis < 3; ++axis) {
    for (int z = 0; z < (dz != 0 ? 1 : kBrickEdge); ++z) {
      const uint64_t crossed = owner.crossed[axis][z];
      const uint32_t first = owner.first_vertex + owner.rank[axis][z];
      for (uint64_t remaining = crossed & wanted; remaining != 0; remaining &= remaining - 1) {
        const int bit = std::countr_zero(remaining);
        const int place =
            EdgeVertices::at(axis, dx + bit % kBrickEdge, dy + bit / kBrickEdge, dz + z);
        vertices[place] = first + bit_count(crossed & ((uint64_t{1} << bit) - 1));
      }
    }
  }
}

void BrickSurface::write_triangles(size_t n, std::span<Triangle> triangles) const {
  const SurfaceBrick& brick = bricks_[n];
  if (brick.triangle_count == 0) return;
  EdgeVertices vertices;
  for (int side = 0; side < 8; ++side) {
    const int index = map_.index_of(in_map(corner(brick.at, side)));
    if (index >= 0) number_edges(bricks_[index], side, vertices);
  }
  Triangle* triangle = &triangles[brick.first_triangle];
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

int64_t BrickSurface::vertex_on(const LatticeEdge& edge) const {
  // Shifts round down, which is needed for coordinates of -1.
  const auto& [x, y, z] = edge.voxel;
  const int index = map_.index_of({(x >> 3) + 1, (y >> 3) + 1, (z >> 3) + 1});
  if (index < 0) return -1;
  const SurfaceBrick& owner = bricks_[index];
  const uint64_t crossed = owner.crossed[edge.axis][z & 7];
  const uint64_t bit = uint64_t{1} << (kBrickEdge * (y & 7) + (x & 7));
  if ((crossed & bit) == 0) return -1;
  return int64_t{owner.first_vertex} + owner.rank[edge.axis][z & 7] +
         bit_count(crossed & (bit - 1));
}

}  // namespace v3d::codec
