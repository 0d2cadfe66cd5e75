// What a visual hull has too much and cameras can tell: the space between arms and belly, over
// which every silhouette spans a skin.
#pragma once

#include <memory>

#include "base/mesh.h"
#include "recon/sparse_volume.h"
#include "recon/surface_camera.h"

namespace v3d {

/// Looks through the surface of the hull for the depth at which any two cameras agree, 25 voxels
/// deep, with what neighbours find as a guide (correlate_pairs(), LabelField). Where they agree
/// about a place, they see it through all that lies before it: voxels that are seen through more
/// often than something is seen in them go (SightVotes, VolumeCut), but none without which a camera
/// would look through the hull where it sees something (uncovered()). What that opens is looked at
/// once more, from its own surface, and votes with the rest. After the probabilistic
/// visibility of Hernandez, Vogiatzis and Cipolla (CVPR 2007), with belief propagation on the
/// surface in the place of depth maps and a majority in the place of a cut of least cost.
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
  SparseVolume carve(const SurfaceCameras& cameras, const Mesh& hull, const SparseVolume& volume);

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace v3d
