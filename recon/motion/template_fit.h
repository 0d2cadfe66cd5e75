// Fit of a template surface to one pulse: the motion of its graph, then a displacement of each
// vertex; and how well the pulse confirms the positions of the vertices.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "recon/mesh/mesh_neighbours.h"
#include "recon/motion/deformation_graph.h"
#include "recon/motion/position_filter.h"
#include "recon/motion/segment_tracker.h"
#include "recon/motion/surface_patches.h"

namespace v3d::recon {

/// A step of the fit, from coarse to fine.
struct FitStage {
  int repeats;               ///< each with new targets on the observed surface
  double radius_m;           ///< of the farthest target on the observed surface
  double min_facing;         ///< cosine of the normals of a vertex and its target
  double rigidity, bending;  ///< GraphSolverOptions
  float reach_m;             ///< of the patch search; negative: none
  bool reverse;              ///< targets also from the observed surface to the template
};

/// A template and its motion at one pulse after the other. One caller at a time; works in the
/// caller's TBB arena. Deterministic: independent of thread count.
class TemplateFit {
 public:
  /// `rest` is the template. Takes `options.node_spacing_m`, `patch_spacing_m` and `photometry`.
  TemplateFit(Mesh rest, const TrackingOptions& options);

  const Mesh& rest() const { return rest_; }
  std::vector<Eigen::Vector3f>& rest_vertices() { return rest_.vertices; }
  DeformationGraph& graph() { return graph_; }

  /// Improves `motion`, one entry per node, by the stages in turn; then as pose().
  void fit(const ObservedSurface& now, std::span<const FitStage> stages,
           std::vector<NodeMotion>& motion);
  /// Moves the template, and finds which cameras see its vertices. The functions below refer to
  /// this pulse and motion.
  void pose(const ObservedSurface& now, const std::vector<NodeMotion>& motion);

  /// Learns the appearance of patches that face a camera for the first time.
  void learn_patches(const ObservedSurface& now);
  /// The displacements to the observed surface of the vertices that a camera sees, at most
  /// `limit_m`.
  NormalDisplacements normal_displacements(const ObservedSurface& now, float limit_m) const;
  /// `detail` smoothed over the surface: the way of each vertex along its normal, metres. Depends
  /// on neither pulse nor motion.
  std::vector<float> displacements(const NormalDisplacements& detail) const;
  const std::vector<Eigen::Vector3f>& vertices() const { return moved_.vertices; }
  const std::vector<Eigen::Vector3f>& normals() const { return normals_; }
  /// The number of cameras that see each vertex; 2 for all where only meshes are known.
  const std::vector<uint8_t>& visible_cameras() const { return visible_in_; }
  /// Of the last stage of fit(); none without images and without photometry.
  const PatchMatches& patch_matches() const { return matches_; }
  /// SurfacePatches::nearest()
  uint32_t nearest_patch(size_t vertex) const { return patches_.nearest(vertex); }

  PulseResidual residual(const ObservedSurface& now, double far_m) const;

  /// Distances of the nodes from the observed surface, each up to 0.2 m.
  static std::vector<double> node_distances(const ObservedSurface& now,
                                            std::span<const NodeMotion> motion);

 private:
  bool uses_images(const ObservedSurface& now) const {
    return photometry_ && !now.pulse().cameras.cameras.empty();
  }
  SeenSurface surface_views(const ObservedSurface& now) const {
    return {&now.pulse().cameras, &moved_, &normals_, depths_};
  }
  void move(const std::vector<NodeMotion>& motion);
  std::vector<double> seen_distances(const ObservedSurface& now) const;
  void run_stage(const ObservedSurface& now, const FitStage& stage,
                 std::vector<NodeMotion>& motion);
  void add_surface_targets(const ObservedSurface& now, const FitStage& stage,
                           std::vector<VertexTarget>& targets) const;
  void add_reverse_targets(const ObservedSurface& now, const FitStage& stage,
                           std::vector<VertexTarget>& targets) const;
  void add_patch_targets(const ObservedSurface& now, const FitStage& stage,
                         std::vector<VertexTarget>& targets);

  Mesh rest_, moved_;
  Neighbours neighbours_;
  DeformationGraph graph_;
  GraphSolver solver_;
  SurfacePatches patches_;
  const bool photometry_;

  std::vector<Eigen::Vector3f> normals_;
  std::vector<DepthBuffer> depths_;
  std::vector<uint8_t> visible_in_;
  std::vector<Eigen::Matrix3f> patch_rotations_;  ///< rotations at the patches
  PatchMatches matches_;                          ///< of the last stage
};

/// Confidences of the vertices at ascending pulses of a segment. Each is 255 times the product of
///   - a third of the number of cameras that see the vertex, at most 1;
///   - exp(-(r / 10 mm)^2), where r is the displacement along the normal from the fitted graph to
///     the observed surface. Without one the vertex is only predicted, and the factor is 0;
///   - exp(-(s / 10 mm)^2), where s is the distance of the nearest patch from where it was found,
///     in the directions of its texture;
///   - 1 less a twentieth for each pulse since the nearest patch was found last at which a camera
///     shows it whole, at most ten: there the surface has probably slid.
/// The last two are 1 where the nearest patch was never learnt, and without images. One thread.
class VertexConfidence {
 public:
  /// Of the next pulse, after TemplateFit::fit(). `detail`: its displacements at this pulse.
  std::vector<uint8_t> of_pulse(const TemplateFit& fit, const NormalDisplacements& detail);

 private:
  /// The factor of each patch, by its vertex.
  std::vector<float> patch_factors(const TemplateFit& fit);

  std::vector<uint8_t> missing_;  ///< by the vertex of a patch: successive pulses without a match
};

}  // namespace v3d::recon
