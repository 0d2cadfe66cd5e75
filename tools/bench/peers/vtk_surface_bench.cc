// Benchmark of VTK's discrete marching cubes, and of its faster variant, discrete flying edges, on
// the volume of mesh/8mm.
//
// VTK needs dense images: it gets the smallest box with all occupied voxels and a margin of one
// voxel, made beforehand and not timed (the whole space has ten times as many cells). Triangles
// only: normals, gradients and scalars are off. Marching cubes runs on one thread, flying edges on
// VTK's default number.
#include <vtkDiscreteFlyingEdges3D.h>
#include <vtkDiscreteMarchingCubes.h>
#include <vtkImageData.h>
#include <vtkNew.h>
#include <vtkPolyData.h>

#include <algorithm>
#include <array>

#include "rates.h"
#include "workload.h"

namespace v3d::bench {
namespace {

struct VoxelBox {
  std::array<int, 3> low, high;  ///< first and last occupied voxel
};

/// Calls `visit(i, j, k)` for every occupied voxel.
template <class Visit>
void for_each_voxel(const SparseVolume& volume, Visit visit) {
  for (size_t n = 0; n < volume.bricks().size(); ++n) {
    const BrickCoord at = volume.coords()[n];
    for (int bit = 0; bit < 512; ++bit) {
      if ((volume.bricks()[n][bit / 64] >> (bit % 64)) & 1) {
        visit(8 * at.x + bit % 8, 8 * at.y + bit / 8 % 8, 8 * at.z + bit / 64);
      }
    }
  }
}

VoxelBox bounds(const SparseVolume& volume) {
  VoxelBox box{{VoxelGrid::kMaxCount, VoxelGrid::kMaxCount, VoxelGrid::kMaxCount}, {0, 0, 0}};
  for_each_voxel(volume, [&](int i, int j, int k) {
    const std::array voxel = {i, j, k};
    for (int axis = 0; axis < 3; ++axis) {
      box.low[axis] = std::min(box.low[axis], voxel[axis]);
      box.high[axis] = std::max(box.high[axis], voxel[axis]);
    }
  });
  return box;
}

vtkNew<vtkImageData> dense(const SparseVolume& volume) {
  const VoxelBox box = bounds(volume);
  vtkNew<vtkImageData> image;
  image->SetExtent(box.low[0] - 1, box.high[0] + 1, box.low[1] - 1, box.high[1] + 1, box.low[2] - 1,
                   box.high[2] + 1);
  image->SetSpacing(volume.grid().voxel_m, volume.grid().voxel_m, volume.grid().voxel_m);
  image->AllocateScalars(VTK_UNSIGNED_CHAR, 1);
  std::fill_n(static_cast<uint8_t*>(image->GetScalarPointer()), image->GetNumberOfPoints(), 0);
  for_each_voxel(volume, [&](int i, int j, int k) {
    *static_cast<uint8_t*>(image->GetScalarPointer(i, j, k)) = 1;
  });
  return image;
}

template <class Filter>
void vtk_surface(benchmark::State& state, double voxel_m) {
  const vtkNew<vtkImageData> image = dense(volume(voxel_m));
  vtkNew<Filter> filter;
  filter->SetInputData(image);
  filter->ComputeNormalsOff();
  filter->ComputeGradientsOff();
  filter->ComputeScalarsOff();
  filter->SetValue(0, 1);
  measure(state, 1, 0, [&] {
    filter->Modified();
    filter->Update();
  });
  state.counters["triangles"] = static_cast<double>(filter->GetOutput()->GetNumberOfPolys());
}

void vtk_marching_cubes(benchmark::State& state) {
  vtk_surface<vtkDiscreteMarchingCubes>(state, 0.008);
}
void vtk_flying_edges(benchmark::State& state) {
  vtk_surface<vtkDiscreteFlyingEdges3D>(state, 0.008);
}

BENCHMARK(vtk_marching_cubes)->Name("peer/vtk_discrete_mc/8mm");
BENCHMARK(vtk_flying_edges)->Name("peer/vtk_discrete_flying_edges/8mm");

}  // namespace
}  // namespace v3d::bench
