// All cameras before a block of vertices.
#pragma once

#include <span>
#include <vector>

#include "recon/surface/template_windows.h"

namespace v3d {

/// What they see of it, and where its windows fall in their pictures. Keeps its memory; one to a
/// thread.
class Onlookers {
 public:
  /// `places` and `normals` (unit length) of BlockSight::kMost vertices at most, world, metres.
  /// `depths` are of the mesh, one per camera.
  void look(std::span<const Eigen::Vector3f> places, std::span<const Eigen::Vector3f> normals,
            std::span<const SurfaceCamera> cameras, std::span<const DepthBuffer> depths,
            const SightOptions& options) {
    places_.count = places.size();
    for (size_t i = 0; i < places.size(); ++i) {
      places_.set(i, places[i]);
      normals_.set(i, normals[i]);
    }
    sights_.resize(cameras.size());
    for (size_t c = 0; c < cameras.size(); ++c) {
      see_block(cameras[c], depths[c], places_, normals_, options, sights_[c]);
    }
  }

  /// One per camera, of the last look().
  std::span<const BlockSight> sights() const { return sights_; }

  WindowBlock windows;  ///< to be found from sights()

 private:
  PointBlock places_, normals_;
  std::vector<BlockSight> sights_;
};

}  // namespace v3d
