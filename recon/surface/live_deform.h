// Deformation within the live budget.
#pragma once

#include <cstdint>
#include <memory>

#include "base/geometry/mesh.h"
#include "recon/visibility/surface_camera.h"

namespace v3d::recon {

/// The passes of a LiveDeformer, in the order in which they run. Each needs those before it.
enum class LivePass : uint8_t {
  kCoarse,     ///< depth search at half image resolution
  kFine,       ///< depth search at full image resolution, around the result of the coarse one
  kCrossings,  ///< removal of self-intersections
};

/// How many passes run: the first so many of LivePass. 0: the hull remains as it is.
inline constexpr int kLivePasses = 3;
/// Without the removal of self-intersections, which costs as much as a depth search.
inline constexpr int kDefaultLivePasses = 2;

struct LiveDeformOptions {
  double voxel_m = 0.01;  ///< of the volume that the mesh comes from
  VertexLattice lattice;  ///< of the resulting vertices; those of the mesh must lie on it
};

/// Moves the surface of a visual hull to where the images agree, like Deformer, but faster and
/// coarser. Every fourth vertex has a template window, of 3 x 3 samples. Visibility comes from
/// point depth buffers. There is no concavity carving. In the fine search, silhouettes pull at
/// those of these vertices that lie on the outline of the mesh. A weak pull to the position before
/// a search holds the vertices that no two cameras see.
///
/// Keeps its working memory. One caller at a time; works in the caller's TBB arena. Deterministic:
/// independent of thread count and instruction set.
///
/// Source: section 2.3 of the paper; DisplacementField.
class LiveDeformer {
 public:
  explicit LiveDeformer(const LiveDeformOptions& options);
  ~LiveDeformer();

  /// Moves the vertices of `mesh` (world, metres), which must be closed, by the first `passes`
  /// passes. Triangles do not change. Only LivePass::kCrossings guarantees that no
  /// self-intersections are added. Requires 0 <= passes <= kLivePasses.
  void run(const SurfaceCameras& cameras, int passes, Mesh& mesh);

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace v3d::recon
