// Surface patches: small textured pieces of a template that are found again in the images of other
// pulses. They measure motion along the surface.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <limits>
#include <optional>
#include <span>
#include <vector>

#include "base/geometry/mesh.h"
#include "recon/motion/deformation_graph.h"
#include "recon/visibility/surface_camera.h"

namespace v3d::recon {

// Joint search for the shifts of patches: each patch has a correlation for every shift, and
// neighbouring patches shift alike.

/// A whole number of steps along the two axes of a patch.
struct PatchShift {
  int across = 0, down = 0;
  float correlation = 0;  ///< of the patch at this shift
};

/// Correlations of patches at all shifts up to `reach` steps along each axis.
class ShiftCorrelations {
 public:
  static constexpr int kMaxReach = 8;

  ShiftCorrelations(size_t patches, int reach);

  int reach() const { return reach_; }
  int edge() const { return 2 * reach_ + 1; }
  size_t shifts() const { return static_cast<size_t>(edge()) * static_cast<size_t>(edge()); }

  /// Row by row, from the shift (-reach, -reach).
  std::span<float> of(size_t patch) { return {&values_[patch * shifts()], shifts()}; }
  std::span<const float> of(size_t patch) const { return {&values_[patch * shifts()], shifts()}; }
  size_t patches() const { return known_.size(); }
  void set_known(size_t patch) { known_[patch] = 1; }
  bool is_known(size_t patch) const { return known_[patch] != 0; }

 private:
  int reach_;
  std::vector<float> values_;
  std::vector<uint8_t> known_;
};

/// Two patches whose axes have nearly the same directions.
struct PatchNeighbours {
  uint32_t a = 0, b = 0;
};

/// The most likely shift of each known patch, by min-sum belief propagation with a truncated linear
/// cost of the difference of two neighbours. Empty for unknown patches, and at the border of the
/// search. Works in the caller's TBB arena; independent of thread count.
///
/// Source: Felzenszwalb and Huttenlocher, Efficient belief propagation for early vision, IJCV 2006.
std::vector<std::optional<PatchShift>> likely_shifts(const ShiftCorrelations& correlations,
                                                     std::span<const PatchNeighbours> neighbours);

// Patches of a template.

/// The surface of a pulse as the cameras see it; all of it is borrowed. `depths` are the depth
/// buffers of `surface`, one per camera.
struct SeenSurface {
  const SurfaceCameras* cameras = nullptr;
  const Mesh* surface = nullptr;
  const std::vector<Eigen::Vector3f>* normals = nullptr;
  std::span<const DepthBuffer> depths;
};

/// Where a patch was found.
struct PatchMatch {
  uint32_t vertex = 0;
  Eigen::Vector3f position = Eigen::Vector3f::Zero();  ///< of the vertex, world, metres
  /// Two orthogonal directions of the surface, and the precision along each: 0 (no texture) to 1.
  std::array<Eigen::Vector3f, 2> directions{};
  std::array<float, 2> precision{};
  float correlation = 0;  ///< with the patch as it was learnt, mean over the cameras
};

/// The result of a search for all learnt patches, in their order.
struct PatchMatches {
  std::vector<PatchMatch> found;
  /// Vertices of learnt patches that a camera shows whole, but not as they were learnt.
  std::vector<uint32_t> missing;
};

/// Square patches around some vertices of a template. Their appearance is learnt once, in the
/// camera that faces them most, and never updated, so that errors do not accumulate.
///
/// One caller at a time; works in the caller's TBB arena. Deterministic: independent of thread
/// count.
///
/// Source: Furukawa and Ponce, Dense 3D motion capture from synchronized video streams, CVPR 2008
/// (patches of a tracked mesh); Baker and Matthews, Lucas-Kanade 20 years on, IJCV 2004 (inverse
/// compositional alignment).
class SurfacePatches {
 public:
  static constexpr int kSide = 9;  ///< samples along an edge of a patch
  static constexpr uint32_t kNoPatch = std::numeric_limits<uint32_t>::max();
  struct PatchView;

  /// Chooses vertices of `rest` about `spacing_m` apart.
  SurfacePatches(const Mesh& rest, double spacing_m);

  size_t size() const { return patches_.size(); }
  /// The vertex of the patch that is nearest to `vertex` along the surface; kNoPatch for a vertex
  /// without one.
  uint32_t nearest(size_t vertex) const { return nearest_[vertex]; }

  /// Learns the patches that have no appearance yet and face a camera well.
  /// `rotations`: of the surface around each patch since rest.
  void learn(const SeenSurface& seen, std::span<const Eigen::Matrix3f> rotations);

  /// Searches the learnt patches around the positions of their vertices. `reach_m`: how far a match
  /// may be, at most 56 mm. Where it is more than 4 mm, a joint search of all patches
  /// (likely_shifts()) precedes the alignment.
  PatchMatches match(const SeenSurface& seen, std::span<const Eigen::Matrix3f> rotations,
                     float reach_m) const;

  /// Rotations of the surface around each patch, for learn() and match().
  std::vector<Eigen::Matrix3f> rotations(const DeformationGraph& graph,
                                         std::span<const NodeMotion> motion) const;

 private:
  static constexpr int kLearntSide = kSide + 2;  ///< with a border, for gradients
  static constexpr size_t kLevels = 2;           ///< fine, coarse

  /// Samples of a patch, row by row, less their mean, divided by their standard deviation.
  template <int kEdge>
  using Samples = std::array<float, static_cast<size_t>(kEdge) * kEdge>;

  struct Appearance {
    Samples<kSide> samples{};
    Samples<kSide> across{}, down{};                      ///< change of the samples for one step
    Eigen::Matrix2f curvature = Eigen::Matrix2f::Zero();  ///< sum of squared gradients
    float contrast = 0;                                   ///< standard deviation, grey values
  };
  struct Patch {
    uint32_t vertex = 0;
    /// Unit axes in the tangent plane at rest.
    Eigen::Vector3f across = Eigen::Vector3f::Zero(), down = Eigen::Vector3f::Zero();
    float facing = 0;  ///< cosine when learnt; 0: not learnt
    std::array<Appearance, kLevels> levels{};
  };
  /// A patch at a pulse: world, metres; unit axes.
  struct Placed {
    Eigen::Vector3f position = Eigen::Vector3f::Zero();
    Eigen::Vector3f across = Eigen::Vector3f::Zero(), down = Eigen::Vector3f::Zero();
  };
  struct View {
    uint32_t camera = 0;
    float facing = 0;
  };
  struct Views {
    int count = 0;
    std::array<View, 3> list;
  };

  void find_views(const SeenSurface& seen, float min_facing, std::vector<Views>& views) const;
  static std::vector<PatchView> views_of(const SeenSurface& seen, const Views& views,
                                         const Placed& at, size_t level);
  std::vector<std::optional<PatchShift>> search(const SeenSurface& seen,
                                                std::span<const Views> views,
                                                std::span<const Placed> placed, int reach) const;
  static std::optional<PatchMatch> align(const Patch& patch, const Placed& at,
                                         std::span<const PatchView> views);
  static bool learn_patch(const SurfaceCamera& camera, const Eigen::Vector3f& position,
                          const Eigen::Matrix3f& rotation, Patch& patch);

  std::vector<Patch> patches_;
  std::vector<PatchNeighbours> neighbours_;
  std::vector<uint32_t> nearest_;  ///< of each vertex: the vertex of a patch
};

}  // namespace v3d::recon
