// Less flicker: surfaces that were made one by one agree where the pictures stand still.
#pragma once

#include <optional>
#include <span>

#include "base/mesh.h"
#include "recon/mesh/vertex_lattice.h"
#include "recon/surface/pulse_views.h"

namespace v3d {

struct TemporalSmoothingOptions {
  double voxel_m = 0.005;  ///< of the volume that the surfaces come from
  /// Where the vertices end; empty: anywhere. Requires that the mesh begins on it.
  std::optional<VertexLattice> lattice = std::nullopt;
};

/// Moves every vertex of `mesh`, the surface that `now` was made with, along its normal to the mean
/// of this surface and those of `beside`: the moments of the pulse before and the pulse after, or
/// one of them. Both, because the mean of three stays with what moves evenly; the one before alone
/// would lag.
///
/// A moment beside counts for a vertex as far as nothing moved there meanwhile, in any camera that
/// sees the vertex: fully where brightness differs by no more than noise, not at all where it
/// plainly differs. So what moves stays as it is, to the bit, and so does what no camera sees, and
/// a surface that lies farther off than a voxel. Two surfaces are compared along the rays of the
/// cameras, in the same pixel of both depth buffers: equal surfaces differ by exactly nothing.
///
/// No new self-intersection (remove_self_intersections()). Works in the caller's TBB arena; the
/// same for any number of threads.
void smooth_over_time(const PulseViews& now, std::span<const PulseViews* const> adjacent,
                      const TemporalSmoothingOptions& options, Mesh& mesh);

}  // namespace v3d
