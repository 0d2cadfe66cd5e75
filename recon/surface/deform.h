// Deformation, its silhouette force, and deformation within the live budget.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>

#include "base/geometry/mesh.h"
#include "recon/visibility/surface_camera.h"

namespace v3d::recon {

// Intra-frame deformation: moves the surface of a visual hull to where the images agree. Source:
// section 2.3 of the paper.

enum class DeformMode {
  /// Searches the depth at which the images agree, coarse to fine, and fits a smooth field to the
  /// result (DisplacementField).
  kSearch,
  /// The paper's gradient steps along F = alpha F_i + beta F_e + gamma F_s, until all are small.
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
  /// kSearch only: the caller carves concavities of the hull first (ConcavityCarver). Deformer
  /// itself ignores it.
  bool carve_concavities = true;
  /// Lattice of the resulting vertices; empty: none. Requires that the vertices of the mesh lie on
  /// it.
  std::optional<VertexLattice> lattice = std::nullopt;
};

/// Throws InputError, which names the field, for a value outside its range.
void check(const DeformOptions& options);

/// Keeps its working memory. One caller at a time; works in the caller's TBB arena.
class Deformer {
 public:
  /// Requires options that pass check().
  explicit Deformer(const DeformOptions& options);
  ~Deformer();

  /// Moves the vertices of `mesh` (world, metres), which must be closed. Triangles do not change,
  /// and no self-intersections are added. Deterministic: independent of thread count and
  /// instruction set.
  void run(const SurfaceCameras& cameras, Mesh& mesh);

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

// Silhouette force: displacement of outline vertices to the observed outline. Source: equation (6)
// of the paper (silhouette preserving force).

/// The pixels of `camera` from which displacement_to_silhouette() may find the outline.
Mask near_silhouette_outline(const SurfaceCamera& camera);

/// The pixels of `camera` near the outline of the mesh. They include all pixels where a vertex may
/// lie on the outline. `depth` is the depth buffer of the mesh.
Mask near_outline(const SurfaceCamera& camera, const DepthBuffer& depth);

/// Largest cosine between the normal of a vertex on an outline and the direction to the camera.
inline constexpr float kMaxOutlineFacing = 0.35F;

/// How far a vertex on the outline of the mesh must move along its normal, metres, so that the
/// outline falls on that of the observed silhouette.
///
/// Both outlines are searched along the projected normal, in the pixels of depth buffer and mask.
/// So a mesh that fills its silhouette has displacement 0. Empty for a vertex off the outline, and
/// where the observed outline is not near.
///
/// `depth` is the depth buffer of the mesh, `seen` is camera.project(position). Requires a grazing
/// vertex (grazing_vertices()) inside near_outline().
std::optional<float> silhouette_displacement(const SurfaceCamera& camera, const DepthBuffer& depth,
                                             const Eigen::Vector3f& position,
                                             const Eigen::Vector3f& normal,
                                             const SurfaceCamera::Seen& seen);

/// The same for a vertex that lies on the outline of the mesh itself: how far the outline of the
/// observed silhouette is. Requires a grazing vertex inside near_silhouette_outline().
std::optional<float> displacement_to_silhouette(const SurfaceCamera& camera,
                                                const Eigen::Vector3f& position,
                                                const Eigen::Vector3f& normal,
                                                const SurfaceCamera::Seen& seen);

// Deformation within the live budget.

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

/// Returns whether there is time for the next pass. Called by the thread that runs the deformation,
/// once for each pass that would run. Empty: always.
using PassCheck = std::function<bool()>;

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
  /// passes. Stops before a pass, except before the first one, for which `may_run` returns false.
  /// Returns the number of passes: a call with this number and without `may_run` makes the same
  /// mesh. Triangles do not change. Only LivePass::kCrossings guarantees that no self-intersections
  /// are added. Requires 0 <= passes <= kLivePasses.
  int run(const SurfaceCameras& cameras, int passes, Mesh& mesh, const PassCheck& may_run = {});

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace v3d::recon
