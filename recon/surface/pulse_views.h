// What the cameras saw at one pulse, and how far, before the surface that was made of it stopped
// them: what a surface of the pulse before or after is held against.
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "recon/surface/concavity_carving.h"
#include "recon/visibility/surface_camera.h"

namespace v3d {

/// Owns all that it needs. Any thread, while nobody sets anything.
class PulseViews {
 public:
  struct View {
    const SurfaceCamera& camera;
    const DepthBuffer& depth;  ///< of the surface
  };

  /// One entry of `models` and `frames` per camera of the rig; a frame is null, or without pixels,
  /// where the camera saw nothing. Frames have masks and are copied. `hull`: where it is says how
  /// finely they can see it; `voxel_m` is of its volume. Works in the caller's TBB arena.
  PulseViews(std::span<const CameraModel> models, std::span<const Frame* const> frames,
             const Mesh& hull, double voxel_m);
  // Copies would refer to the frames of the original.
  PulseViews(PulseViews&&) = default;
  PulseViews& operator=(PulseViews&&) = default;

  /// Those that saw something.
  const SurfaceCameras& cameras_with_pixels() const { return surface_cameras_; }
  /// What those saw in the hollows of the hull, for the carving of this pulse and of those beside.
  StereoSamples stereo_samples;

  /// Draws the surface, for view(). Works in the caller's TBB arena.
  void set_surface(const Mesh& surface);

  size_t cameras() const { return numbers_.size(); }  ///< of the rig
  /// Empty for a camera that saw nothing. Requires set_surface().
  std::optional<View> view(size_t camera) const {
    const int number = numbers_[camera];
    return number >= 0 ? std::optional<View>({surface_cameras_.cameras[number], depths_[number]})
                       : std::nullopt;
  }

 private:
  friend NeighbourSamples neighbour_samples(const PulseViews& now, const PulseViews& then);

  std::vector<Frame> frames_;  ///< one per camera of the rig; seeing_ refers to them
  SurfaceCameras surface_cameras_;
  std::vector<int> numbers_;         ///< of the rig's cameras in seeing_; -1: saw nothing
  std::vector<DepthBuffer> depths_;  ///< of those
};

/// What `then`, the pulse before or after, tells of the hollows `now`. Refers to both.
NeighbourSamples neighbour_samples(const PulseViews& now, const PulseViews& then);

}  // namespace v3d
