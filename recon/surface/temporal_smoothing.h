// Views of adjacent pulses, motion, smoothing.
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "base/geometry/mesh.h"
#include "recon/surface/concavity_carving.h"
#include "recon/visibility/surface_camera.h"

namespace v3d::recon {

// Motion mask: where the image of one camera did not change between two pulses.

/// 1 where the image around `pixel` did not change between the two pulses, 0 where it clearly
/// changed, and a ramp between them.
///
/// Compares the brightness of 3 x 3 pixels at half resolution. 0 beyond the border of an image, and
/// where the silhouette at `then` is not near the pixel.
float static_weight(const SurfaceCamera& now, const SurfaceCamera& then,
                    const Eigen::Vector2f& pixel);

// The images of one pulse with the depth buffers of the surface that was made from them. The
// surfaces of adjacent pulses are compared with it.

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

// Temporal smoothing: reduces flicker between surfaces that were reconstructed pulse by pulse.

struct TemporalSmoothingOptions {
  double voxel_m = 0.005;  ///< of the volume that the surfaces come from
  /// Lattice of the resulting vertices; empty: none. Requires that the vertices of the mesh lie on
  /// it.
  std::optional<VertexLattice> lattice = std::nullopt;
};

/// Moves each vertex of `mesh`, the surface of `now`, along its normal to the mean of this surface
/// and those of `adjacent`: the views of the pulse before and of the pulse after, or one of them.
/// With both, steady motion is preserved; with one alone, the mean lags.
///
/// An adjacent surface counts for a vertex only as far as the images did not change there, in any
/// camera that sees the vertex: fully where brightness differs by noise, not at all where it
/// clearly differs. A surface that is farther than a voxel is ignored. So moving vertices, and
/// vertices that no camera sees, stay as they are to the bit.
///
/// Surfaces are compared along camera rays, in the same pixel of both depth buffers, so equal
/// surfaces differ by exactly 0. No self-intersections are added (remove_self_intersections()).
/// Works in the caller's TBB arena; independent of thread count.
void smooth_over_time(const PulseViews& now, std::span<const PulseViews* const> adjacent,
                      const TemporalSmoothingOptions& options, Mesh& mesh);

}  // namespace v3d::recon
