// Geodesic integral function of a mesh: how far each vertex is from the rest of the surface.
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "base/geometry/mesh.h"
#include "recon/skeleton/vertex_graph.h"

namespace v3d::recon {

struct GeodesicOptions {
  size_t samples = 900;  ///< of the graph in which paths run, about
  size_t bases = 40;     ///< samples from which distances are integrated, about
};

/// One value for each vertex; vertices without a triangle have `component` kNoComponent.
struct GeodesicIntegral {
  static constexpr uint32_t kNoComponent = 0xFFFFFFFF;
  std::vector<float> metres;  ///< mean geodesic distance to the surface of the component
  /// (mean - least) / greatest of the component: 0 to below 1, 0 in the middle of the body.
  std::vector<float> normalised;
  std::vector<uint32_t> component;  ///< connected part of the surface, from 0
  size_t components = 0;
};

/// Area of each vertex: a third of its triangles, square metres.
std::vector<double> vertex_areas(const Mesh& mesh);

/// Integrates geodesic distances over each connected component of a mesh: with holes, handles and
/// edges of more than two triangles. `graph`: of the mesh. Requires finite positions.
///
/// Samples cover the surface by geodesic balls. Paths run between samples whose regions touch, and
/// those two steps apart (short cut edges). Bases cover the samples in the same way; the area of
/// its region is the weight of a base. Values of vertices are interpolated between samples.
/// Deterministic; independent of thread count, and of rigid motion and the order of vertices except
/// for ties. Thread-safe; works in the caller's TBB arena. Source: Hilaga et al., Topology
/// matching, SIGGRAPH 2001, equations (1) to (4).
GeodesicIntegral geodesic_integral(const Mesh& mesh, const VertexGraph& graph,
                                   const GeodesicOptions& options = {});

}  // namespace v3d::recon
