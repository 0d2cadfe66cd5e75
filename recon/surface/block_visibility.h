// All cameras before a block of vertices.
#pragma once

#include <span>
#include <vector>

#include "recon/surface/template_windows.h"

namespace v3d {

/// What they see of it, and where its windows fall in their pictures. Keeps its memory; one to a
/// thread.
class BlockVisibility {
 public:
  /// `places` and `normals` (unit length) of VertexVisibility::kMost vertices at most, world,
  /// metres. `depths` are of the mesh, one per camera.
  void compute(std::span<const Eigen::Vector3f> places, std::span<const Eigen::Vector3f> normals,
               std::span<const SurfaceCamera> cameras, std::span<const DepthBuffer> depths,
               const VisibilityOptions& options) {
    places_.count = places.size();
    for (size_t i = 0; i < places.size(); ++i) {
      places_.set(i, places[i]);
      normals_.set(i, normals[i]);
    }
    by_camera_.resize(cameras.size());
    for (size_t c = 0; c < cameras.size(); ++c) {
      test_visibility(cameras[c], depths[c], places_, normals_, options, by_camera_[c]);
    }
  }

  /// One per camera, of the last look().
  std::span<const VertexVisibility> by_camera() const { return by_camera_; }

  WindowBlock windows;  ///< to be found from sights()

 private:
  PointBlock places_, normals_;
  std::vector<VertexVisibility> by_camera_;
};

}  // namespace v3d
