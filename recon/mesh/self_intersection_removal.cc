#include "recon/mesh/self_intersection_removal.h"

#include "recon/mesh/self_intersection.h"
#include "recon/mesh/smooth_surface.h"
#include "recon/mesh/vertex_loop.h"

namespace v3d {
namespace {

using Eigen::Vector3f;

// Largest number of passes of each kind. Resetting to `start` continues until nothing intersects.
constexpr int kSmoothings = 4;
constexpr int kHalfWaysBack = 6;
constexpr int kStepsPerSmoothing = 4;

/// A sparse subset of the vertices of a mesh.
class Region {
 public:
  explicit Region(const Mesh& mesh) : marks_(mesh.vertices.size(), 0) {}

  /// Adds the corners of all triangles that intersect.
  void add_corners(const std::vector<Crossing>& crossings, const Mesh& mesh) {
    for (const auto& [s, t] : crossings) {
      for (const uint32_t v : mesh.triangles[s]) add(v);
      for (const uint32_t v : mesh.triangles[t]) add(v);
    }
  }

  /// Adds the neighbours of all vertices of the region, `rings` times.
  void widen(const Neighbours& neighbours, int rings) {
    for (int ring = 0; ring < rings; ++ring) {
      const size_t end = vertices_.size();
      for (; widened_ < end; ++widened_) {
        for (const uint32_t n : neighbours.of(vertices_[widened_])) add(n);
      }
    }
  }

  const std::vector<uint8_t>& marks() const { return marks_; }  ///< one per vertex of the mesh
  const std::vector<uint32_t>& vertices() const { return vertices_; }

  template <class Work>
  void for_each(const Work& work) const {
    for_each_vertex(vertices_.size(), [&](size_t i) { work(vertices_[i]); });
  }

 private:
  void add(uint32_t v) {
    if (marks_[v]) return;
    marks_[v] = 1;
    vertices_.push_back(v);
  }

  std::vector<uint8_t> marks_;
  std::vector<uint32_t> vertices_;
  size_t widened_ = 0;  ///< number of vertices whose neighbours are in the region
};

/// Moves each vertex half of the way to the mean of its neighbours.
void smooth(const Neighbours& neighbours, const Region& region, Mesh& mesh) {
  const std::vector<uint32_t>& vertices = region.vertices();
  std::vector<Vector3f> moved(vertices.size());
  for_each_vertex(moved.size(), [&](size_t i) {
    moved[i] =
        mesh.vertices[vertices[i]] + 0.5F * internal_force(neighbours, mesh.vertices, vertices[i]);
  });
  for_each_vertex(moved.size(), [&](size_t i) { mesh.vertices[vertices[i]] = moved[i]; });
}

void pull_half_way_back(const Region& region, const std::vector<Vector3f>& start, Mesh& mesh) {
  region.for_each([&](uint32_t v) { mesh.vertices[v] += 0.5F * (start[v] - mesh.vertices[v]); });
}

}  // namespace

size_t remove_self_intersections(const Neighbours& neighbours, const std::vector<Vector3f>& start,
                                 const std::optional<VertexLattice>& lattice, Mesh& mesh) {
  const auto snap = [&](size_t v) {
    if (lattice) mesh.vertices[v] = rounded_to(*lattice, mesh.vertices[v]);
  };
  for_each_vertex(mesh.vertices.size(), snap);
  CrossingFinder finder(mesh);
  std::vector<Crossing> crossings = finder.all();
  for (int pass = 0; pass < kSmoothings + kHalfWaysBack && !crossings.empty(); ++pass) {
    Region region(mesh);
    region.add_corners(crossings, mesh);
    if (pass < kSmoothings) {
      region.widen(neighbours, 1);
      for (int i = 0; i < kStepsPerSmoothing; ++i) smooth(neighbours, region, mesh);
    } else {
      region.widen(neighbours, pass - kSmoothings);
      pull_half_way_back(region, start, mesh);
    }
    region.for_each(snap);
    // Intersections without a moved triangle were removed in an earlier pass.
    crossings = finder.of_moved(region.marks());
  }
  Region reset(mesh);
  for (size_t before = 0; !crossings.empty(); before = reset.vertices().size()) {
    reset.add_corners(crossings, mesh);
    reset.widen(neighbours, kHalfWaysBack);
    if (reset.vertices().size() == before) break;  // `start` intersects itself
    reset.for_each([&](uint32_t v) { mesh.vertices[v] = start[v]; });
    crossings = finder.of_moved(reset.marks());
  }
  return crossings.size();
}

}  // namespace v3d
