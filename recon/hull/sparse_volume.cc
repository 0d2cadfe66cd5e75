#include "recon/hull/sparse_volume.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <atomic>
#include <utility>

#include "base/core/error.h"
#include "codec/bricks.h"

namespace v3d::recon {

codec::Brick bits_inside(const VoxelGrid& grid, codec::BrickCoord at) {
  const auto inside = [](int64_t count, int brick) {
    return static_cast<int>(std::clamp<int64_t>(count - int64_t{codec::kBrickEdge} * brick, 0, 8));
  };
  const int nx = inside(grid.counts[0], at.x);
  const int ny = inside(grid.counts[1], at.y);
  const int nz = inside(grid.counts[2], at.z);
  uint64_t layer = 0;
  for (int y = 0; y < ny; ++y) {
    layer |= ((uint64_t{1} << nx) - 1) << (codec::kBrickEdge * y);
  }
  codec::Brick bits{};
  std::fill_n(bits.begin(), nz, layer);
  return bits;
}

SparseVolume::SparseVolume(const VoxelGrid& grid) { assign(grid, {}); }

SparseVolume::SparseVolume(const VoxelGrid& grid,
                           std::span<const std::span<const PlacedBrick>> parts) {
  assign(grid, parts);
}

void SparseVolume::assign(const VoxelGrid& grid,
                          std::span<const std::span<const PlacedBrick>> parts) {
  grid_ = grid;
  std::array<int, 3> counts{};
  for (int axis = 0; axis < 3; ++axis) {
    V3D_CHECK(grid.counts[axis] > 0 && grid.counts[axis] <= VoxelGrid::kMaxCount);
    counts[axis] =
        static_cast<int>((grid.counts[axis] + codec::kBrickEdge - 1) / codec::kBrickEdge);
  }
  occupied_.clear(counts);
  mark(parts);
  place(parts);
}

void SparseVolume::mark(std::span<const std::span<const PlacedBrick>> parts) {
  tbb::parallel_for(size_t{0}, parts.size(), [&](size_t n) {
    for (const PlacedBrick& brick : parts[n]) {
      if (brick.bits == codec::Brick{}) continue;
      std::atomic_ref<uint64_t> word(occupied_.word(brick.at));
      word.fetch_or(codec::BrickMap::bit(brick.at), std::memory_order_relaxed);
    }
  });
  const int count = occupied_.number();
  bricks_.resize(count);
  coords_.resize(count);
}

void SparseVolume::place(std::span<const std::span<const PlacedBrick>> parts) {
  for (const auto& part : parts) {
    tbb::parallel_for(tbb::blocked_range<size_t>(0, part.size(), 256), [&](const auto& range) {
      for (size_t n = range.begin(); n < range.end(); ++n) {
        if (part[n].bits == codec::Brick{}) continue;
        const int index = index_of(part[n].at);
        bricks_[index] = part[n].bits;
        coords_[index] = part[n].at;
      }
    });
  }
}

bool SparseVolume::get(int i, int j, int k) const {
  if (!grid_.contains(i, j, k)) return false;
  const int brick = index_of({i / codec::kBrickEdge, j / codec::kBrickEdge, k / codec::kBrickEdge});
  return brick >= 0 && (bricks_[brick][k % codec::kBrickEdge] >>
                            (codec::kBrickEdge * (j % codec::kBrickEdge) + i % codec::kBrickEdge) &
                        1) != 0;
}

int64_t SparseVolume::count() const {
  int64_t n = 0;
  for (const codec::Brick& brick : bricks_) {
    for (const uint64_t word : brick) n += codec::bit_count(word);
  }
  return n;
}

int64_t count_common(const SparseVolume& a, const SparseVolume& b) {
  V3D_CHECK(a.grid() == b.grid());
  int64_t common = 0;
  for (size_t n = 0; n < a.bricks().size(); ++n) {
    const int other = b.index_of(a.coords()[n]);
    for (int z = 0; other >= 0 && z < codec::kBrickEdge; ++z) {
      common += codec::bit_count(a.bricks()[n][z] & b.bricks()[other][z]);
    }
  }
  return common;
}

int64_t count_differing(const SparseVolume& a, const SparseVolume& b) {
  return a.count() + b.count() - 2 * count_common(a, b);
}

// Parallel loops over the bricks for the steps of codec/bricks.h.

/// Working memory of MarchingCubes.
class MarchingCubes::Surface {
 public:
  void make(const SparseVolume& volume, Mesh& mesh);

 private:
  void place_lattice(const VoxelGrid& grid);

  VoxelGrid lattice_;                            ///< of positions_
  std::array<std::vector<float>, 3> positions_;  ///< of every half voxel along each axis
  codec::BrickSurface surface_;
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

void MarchingCubes::Surface::make(const SparseVolume& volume, Mesh& mesh) {
  place_lattice(volume.grid());
  surface_.begin(volume.view());
  const size_t bricks = surface_.bricks().size();
  tbb::parallel_for(size_t{0}, bricks, [&](size_t n) { surface_.examine(n); });
  surface_.number();
  mesh.vertices.resize(surface_.vertex_count());
  mesh.triangles.resize(surface_.triangle_count());
  mesh.colours.clear();
  tbb::parallel_for(size_t{0}, bricks, [&](size_t n) {
    surface_.for_each_vertex(n, [&](uint32_t vertex, const codec::HalfVoxels& half) {
      for (int a = 0; a < 3; ++a) mesh.vertices[vertex][a] = positions_[a][half[a]];
    });
    surface_.write_triangles(n, mesh.triangles);
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

}  // namespace v3d::recon
