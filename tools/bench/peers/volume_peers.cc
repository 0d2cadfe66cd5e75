// Benchmark of Open3D's VoxelGrid::CarveSilhouette on the silhouettes, cameras, space and voxels of
// intersect/16mm.
//
// It supports pinhole cameras only, so it gets undistorted masks, made beforehand and not timed. A
// voxel outside an image is kept, as in our code (keep_voxels_outside_image). It has no
// `min_views`, and keeps a voxel when one of its eight corners lies on or beside foreground: its
// hull contains ours and a quarter more. Every volume starts from a full grid; copying a grid takes
// as long as making one. It runs on one thread; there is no option for more.
#include <open3d/camera/PinholeCameraParameters.h>
#include <open3d/geometry/Image.h>
#include <open3d/geometry/VoxelGrid.h>
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

struct PinholeView {
  open3d::camera::PinholeCameraParameters camera;
  open3d::geometry::Image mask;  ///< float, 0 or 1
};

/// The mask without lens distortion.
open3d::geometry::Image undistorted(const CameraModel& lens, const Mask& mask) {
  const ImageSize size = lens.size();
  const Eigen::Matrix3d inverse = lens.matrix().inverse();
  open3d::geometry::Image image;
  image.Prepare(size.width, size.height, 1, 4);
  for (int v = 0; v < size.height; ++v) {
    for (int u = 0; u < size.width; ++u) {
      const Eigen::Vector2d ideal = (inverse * Eigen::Vector3d(u, v, 1)).head<2>();
      const Eigen::Vector2d pixel =
          (lens.matrix() * lens.distort(ideal).homogeneous()).head<2>().array().round();
      const bool foreground = lens.inside_image(pixel) &&
                              mask.get(static_cast<int>(pixel.x()), static_cast<int>(pixel.y()));
      *image.PointerAt<float>(u, v) = foreground ? 1.0F : 0.0F;
    }
  }
  return image;
}

PinholeView pinhole_view(const CameraModel& lens, const Mask& mask) {
  PinholeView view;
  const Eigen::Matrix3d& k = lens.matrix();
  view.camera.intrinsic_.SetIntrinsics(lens.size().width, lens.size().height, k(0, 0), k(1, 1),
                                       k(0, 2), k(1, 2));
  view.camera.extrinsic_.setIdentity();
  view.camera.extrinsic_.topLeftCorner<3, 3>() = lens.cam_from_world().rotation;
  view.camera.extrinsic_.topRightCorner<3, 1>() = lens.cam_from_world().translation;
  view.mask = undistorted(lens, mask);
  return view;
}

std::shared_ptr<open3d::geometry::VoxelGrid> full_grid(double voxel_m) {
  const Eigen::Vector3d extent = space().max - space().min;
  return open3d::geometry::VoxelGrid::CreateDense(space().min, Eigen::Vector3d::Zero(), voxel_m,
                                                  extent.x(), extent.y(), extent.z());
}

void open3d_carve(benchmark::State& state, double voxel_m) {
  std::vector<PinholeView> views;
  for (int c = 0; c < kCameras; ++c) {
    views.push_back(pinhole_view(rig()[c].model, masks()[c]));
  }
  size_t occupied = 0;
  measure(state, 1, 0, [&] {
    const auto grid = full_grid(voxel_m);
    for (const PinholeView& view : views) {
      grid->CarveSilhouette(view.mask, view.camera, true);
    }
    occupied = grid->voxels_.size();
  });
  state.counters["voxels"] = static_cast<double>(occupied);
}

BENCHMARK_CAPTURE(open3d_carve, 16mm, 0.016)->Name("peer/open3d_carve/16mm");

}  // namespace

// Benchmark of VTK's discrete marching cubes, and of its faster variant, discrete flying edges, on
// the volume of mesh/8mm.
//
// VTK needs dense images: it gets the smallest box with all occupied voxels and a margin of one
// voxel, made beforehand and not timed (the whole space has ten times as many cells). Triangles
// only: normals, gradients and scalars are off. Marching cubes runs on one thread, flying edges on
// VTK's default number.

namespace {

struct VoxelBox {
  std::array<int, 3> low, high;  ///< first and last occupied voxel
};

/// Calls `visit(i, j, k)` for every occupied voxel.
template <class Visit>
void for_each_voxel(const recon::SparseVolume& volume, Visit visit) {
  for (size_t n = 0; n < volume.bricks().size(); ++n) {
    const codec::BrickCoord at = volume.coords()[n];
    for (int bit = 0; bit < 512; ++bit) {
      if ((volume.bricks()[n][bit / 64] >> (bit % 64)) & 1) {
        visit(8 * at.x + bit % 8, 8 * at.y + bit / 8 % 8, 8 * at.z + bit / 64);
      }
    }
  }
}

VoxelBox bounds(const recon::SparseVolume& volume) {
  VoxelBox box{
      {recon::VoxelGrid::kMaxCount, recon::VoxelGrid::kMaxCount, recon::VoxelGrid::kMaxCount},
      {0, 0, 0}};
  for_each_voxel(volume, [&](int i, int j, int k) {
    const std::array voxel = {i, j, k};
    for (int axis = 0; axis < 3; ++axis) {
      box.low[axis] = std::min(box.low[axis], voxel[axis]);
      box.high[axis] = std::max(box.high[axis], voxel[axis]);
    }
  });
  return box;
}

vtkNew<vtkImageData> dense(const recon::SparseVolume& volume) {
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
