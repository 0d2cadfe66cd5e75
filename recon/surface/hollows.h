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

/// What the cameras of a pulse agree about when they look through the surface of its hull.
struct HollowSights {
  static constexpr size_t kMostCameras = 6;
  /// A place that cameras agree about.
  struct Sight {
    Eigen::Vector3f place;     ///< world, metres
    Eigen::Vector3f outwards;  ///< unit length: the surface's normal where it was looked through
    float depth_m = 0;         ///< below it
    std::array<uint16_t, kMostCameras> cameras{};  ///< of the SurfaceCameras
    uint8_t count = 0;                             ///< of these, 2 or more
    uint8_t vertices = 0;                          ///< that it speaks for: its votes
  };
  std::vector<Sight> sights;
  std::vector<Mask> covered;  ///< by camera: covered() of the hull
};

/// The sights of another pulse. They hold in so far as nothing moved meanwhile before the cameras.
struct SightsBeside {
  const HollowSights* sights = nullptr;
  /// A camera of that pulse, and the same one now; null where it sees nothing now.
  struct Camera {
    const SurfaceCamera* then = nullptr;
    const SurfaceCamera* now = nullptr;
  };
  std::vector<Camera> cameras;  ///< by their numbers in `sights`
};

/// Looks through the surface of the hull for the depth at which any two cameras agree, 25 voxels
/// deep, with what neighbours find as a guide (correlate_pairs(), LabelField). Where they agree
/// about a place, they see it through all that lies before it: voxels that are seen through more
/// often than something is seen in them go (SightVotes, VolumeCut), but none without which a camera
/// would look through the hull where it sees something (uncovered()). What that opens is looked at
/// twice more, from its own surface. Sights of the pulses before and after vote, too, camera by
/// camera, where nothing moved in the picture: what stands still is carved alike. After the
/// probabilistic visibility of Hernandez, Vogiatzis and Cipolla (CVPR 2007), with belief
/// propagation on the surface in the place of depth maps and a majority in the place of a cut of
/// least cost.
///
/// The paper deforms the mesh of the hull as it is. But a mesh that is pushed into such a hollow
/// keeps the skin as its walls; it has to get another shape first.
///
/// Keeps its working memory. One caller at a time; works in the caller's TBB arena. The result
/// depends neither on the number of threads nor on the instruction set.
class HollowCarver {
 public:
  HollowCarver();
  ~HollowCarver();

  /// `hull` is the surface of `volume`.
  HollowSights look(const SurfaceCameras& cameras, const Mesh& hull, const SparseVolume& volume);
  /// `sights`: what look() saw with the same cameras in this volume.
  SparseVolume carve(const SurfaceCameras& cameras, const SparseVolume& volume,
                     const HollowSights& sights, std::span<const SightsBeside> beside);

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace v3d
