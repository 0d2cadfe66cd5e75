// From a visual hull to the surface that the pictures agree about: the intra-frame deformation of
// the paper's section 2.3.
#pragma once

#include <memory>
#include <optional>
#include <span>

#include "base/mesh.h"
#include "recon/mesh/vertex_lattice.h"
#include "recon/visibility/surface_camera.h"

namespace v3d {

enum class DeformMode {
  /// Our own: looks for the depth at which the pictures agree, coarse to fine, and for a smooth
  /// field through what it finds (DisplacementField).
  kSearch,
  /// The paper's: small steps along F = alpha F_i + beta F_e + gamma F_s until all are small.
  kPaper,
};

struct DeformOptions {
  DeformMode mode = DeformMode::kSearch;
  double voxel_m = 0.005;  ///< of the volume that the mesh comes from
  // The weights of equation (1), with the paper's values. In both modes 0 switches a force off.
  double internal = 0.3;     ///< alpha
  double photometric = 0.4;  ///< beta
  double silhouette = 0.3;   ///< gamma
  int window = 5;            ///< samples along a side of the template window; odd, 3 to 11
  int views = 6;             ///< cameras that take part in a correlation, 2 to 8
  /// Search only: first the hull gets the hollows that cameras see into (ConcavityCarver). For who
  /// makes the mesh; a Deformer keeps the one it is given.
  bool carve_concavities = true;
  /// Where the vertices end; empty: anywhere. Requires that the mesh begins on it.
  std::optional<VertexLattice> lattice = std::nullopt;
};

/// Throws InputError, which names the field, for numbers outside the ranges above.
void check(const DeformOptions& options);

/// Keeps its working memory. One caller at a time; works in the caller's TBB arena.
class Deformer {
 public:
  /// Requires options that pass check().
  explicit Deformer(const DeformOptions& options);
  ~Deformer();

  /// Moves the vertices of a closed mesh; its triangles stay as they are. The result depends
  /// neither on the number of threads nor on the instruction set.
  void run(const SurfaceCameras& cameras, Mesh& mesh);

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace v3d
