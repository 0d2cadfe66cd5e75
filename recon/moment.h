// What the cameras saw at one pulse, and how far, before the surface that was made of it stopped
// them: what a surface of the pulse before or after is held against.
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "recon/surface_camera.h"

namespace v3d {

/// Owns all that it needs, and does not change. Any thread.
class Moment {
 public:
  struct View {
    SurfaceCamera camera;
    DepthBuffer depth;  ///< of the surface
  };

  /// One entry of `models` and `frames` per camera of the rig; a frame is null, or without pixels,
  /// where the camera saw nothing. Frames have masks and are copied. `voxel_m` is of the volume
  /// that the surface comes from. Works in the caller's TBB arena.
  Moment(std::span<const CameraModel> models, std::span<const Frame* const> frames,
         const Mesh& surface, double voxel_m);
  // Copies would refer to the frames of the original.
  Moment(Moment&&) = default;
  Moment& operator=(Moment&&) = default;

  size_t cameras() const { return views_.size(); }
  /// Empty for a camera that saw nothing.
  const std::optional<View>& view(size_t camera) const { return views_[camera]; }

 private:
  std::vector<Frame> frames_;  ///< one per camera; the views refer to them
  std::vector<std::optional<View>> views_;
};

}  // namespace v3d
