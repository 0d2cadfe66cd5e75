// The images of one pulse with the depth buffers of the surface that was made from them. The
// surfaces of adjacent pulses are compared with it.
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "recon/surface/concavity_carving.h"
#include "recon/visibility/surface_camera.h"

namespace v3d {

/// Owns its data. Any thread may read while no member function changes it.
class PulseViews {
 public:
  struct View {
    const SurfaceCamera& camera;
    const DepthBuffer& depth;  ///< of the reconstructed surface
  };

  /// `models` and `frames` have one entry per camera of the rig; a frame is null, or empty, where
  /// the camera has no image. Frames need masks, and are copied. `hull`, whose voxels have edges of
  /// `voxel_m` metres, decides the image resolution. Works in the caller's TBB arena.
  PulseViews(std::span<const CameraModel> models, std::span<const Frame* const> frames,
             const Mesh& hull, double voxel_m);
  // Copies would refer to the frames of the original.
  PulseViews(PulseViews&&) = default;
  PulseViews& operator=(PulseViews&&) = default;

  /// The cameras that have an image, in the order of the rig.
  const SurfaceCameras& cameras_with_pixels() const { return surface_cameras_; }
  /// Stereo samples for the carving of this pulse and of the adjacent ones.
  StereoSamples stereo_samples;

  /// Draws the depth buffers of `surface` for view(). Works in the caller's TBB arena.
  void set_surface(const Mesh& surface);

  size_t cameras() const { return numbers_.size(); }  ///< of the rig
  /// Empty for a camera without an image. Requires set_surface().
  std::optional<View> view(size_t camera) const {
    const int number = numbers_[camera];
    return number >= 0 ? std::optional<View>({surface_cameras_.cameras[number], depths_[number]})
                       : std::nullopt;
  }

 private:
  friend NeighbourSamples neighbour_samples(const PulseViews& now, const PulseViews& then);

  std::vector<Frame> frames_;  ///< one per camera of the rig; the views refer to them
  SurfaceCameras surface_cameras_;
  std::vector<int> numbers_;         ///< by camera of the rig: index of its view; -1: no image
  std::vector<DepthBuffer> depths_;  ///< of those
};

/// The stereo samples of the adjacent pulse `then`, for carving `now`. Borrows both.
NeighbourSamples neighbour_samples(const PulseViews& now, const PulseViews& then);

}  // namespace v3d
