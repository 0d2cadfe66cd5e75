// Parallel loops over the bricks for the steps of codec/brick_surface.h.
#include "recon/hull/marching_cubes.h"

#include <tbb/parallel_for.h>

#include "codec/brick_surface.h"

namespace v3d {

/// Working memory of MarchingCubes.
class MarchingCubes::Surface {
 public:
  void make(const SparseVolume& volume, Mesh& mesh);

 private:
  void place_lattice(const VoxelGrid& grid);

  VoxelGrid lattice_;                            ///< of positions_
  std::array<std::vector<float>, 3> positions_;  ///< of every half voxel along each axis
  BrickSurface surface_;
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
    surface_.for_each_vertex(n, [&](uint32_t vertex, const HalfVoxels& half) {
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

}  // namespace v3d
