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
}  // namespace v3d::bench
