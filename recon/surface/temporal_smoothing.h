// Temporal smoothing: reduces flicker between surfaces that were reconstructed pulse by pulse.
#pragma once

#include <optional>
#include <span>

#include "base/geometry/mesh.h"
#include "recon/mesh/vertex_lattice.h"
#include "recon/surface/pulse_views.h"

namespace v3d {

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

}  // namespace v3d
