// What a visual hull has too much and cameras can tell: the space between arms and belly, over
// which every silhouette spans a skin.
#pragma once

#include <array>
#include <memory>
#include <span>
#include <vector>

#include "base/mask.h"
#include "base/mesh.h"
#include "recon/hull/sparse_volume.h"
#include "recon/visibility/surface_camera.h"

namespace v3d {

/// A place that cameras agree about: the accepted depth of one vertex.
struct StereoSample {
  static constexpr size_t kMaxCameras = 6;
  Eigen::Vector3f place;     ///< world, metres
  Eigen::Vector3f outwards;  ///< unit normal of the surface where the depth search started
  float depth_m = 0;         ///< depth below that surface
  std::array<uint16_t, kMaxCameras> cameras{};  ///< that agree: indices into the SurfaceCameras
  uint8_t count = 0;                            ///< of these, 2 or more
  uint8_t vertices = 0;  ///< number of vertices that the sample represents: its votes
};

/// The stereo samples of one pulse.
struct StereoSamples {
  std::vector<StereoSample> samples;
  std::vector<Mask> covered;  ///< by camera: covered_pixels() of the hull
};

/// The sights of another pulse. They hold in so far as nothing moved meanwhile before the cameras.
struct NeighbourSamples {
  const StereoSamples* samples = nullptr;
  /// A camera of that pulse, and the same one now; null where it sees nothing now.
  struct Camera {
    const SurfaceCamera* then = nullptr;
    const SurfaceCamera* now = nullptr;
  };
  std::vector<Camera> cameras;  ///< by their numbers in `sights`
};

/// Looks through the surface of the hull for the depth at which any two cameras agree, 25 voxels
/// deep, with what neighbours find as a guide (correlate_pairs(), BeliefPropagation). Where they
/// agree about a place, they see it through all that lies before it: voxels that are seen through
/// more often than something is seen in them go (FreeSpaceVotes, VolumeCut), but none without which
/// a camera would look through the hull where it sees something (uncovered_pixels()). What that
/// opens is looked at twice more, from its own surface. Sights of the pulses before and after vote,
/// too, camera by camera, where nothing moved in the picture: what stands still is carved alike.
/// After the probabilistic visibility of Hernandez, Vogiatzis and Cipolla (CVPR 2007), with belief
/// propagation on the surface in the place of depth maps and a majority in the place of a cut of
/// least cost.
///
/// The paper deforms the mesh of the hull as it is. But a mesh that is pushed into such a hollow
/// keeps the skin as its walls; it has to get another shape first.
///
/// Keeps its working memory. One caller at a time; works in the caller's TBB arena. The result
/// depends neither on the number of threads nor on the instruction set.
class ConcavityCarver {
 public:
  ConcavityCarver();
  ~ConcavityCarver();

  /// `hull` is the surface of `volume`.
  StereoSamples find_samples(const SurfaceCameras& cameras, const Mesh& hull,
                             const SparseVolume& volume);
  /// `sights`: what look() saw with the same cameras in this volume.
  SparseVolume carve(const SurfaceCameras& cameras, const SparseVolume& volume,
                     const StereoSamples& samples, std::span<const NeighbourSamples> adjacent);

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace v3d
