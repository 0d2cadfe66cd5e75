#include "recon/untangle.h"

#include <algorithm>

#include "recon/self_intersection.h"
#include "recon/smooth_surface.h"
#include "recon/vertex_loop.h"

namespace v3d {
namespace {

using Eigen::Vector3f;

constexpr int kSmoothings = 4;
constexpr int kStepsPerSmoothing = 4;

using Marks = std::vector<uint8_t>;  ///< one per vertex

Marks corners_of(const std::vector<Crossing>& crossings, const Mesh& mesh) {
  Marks marks(mesh.vertices.size(), 0);
  for (const auto& [s, t] : crossings) {
    for (const uint32_t v : mesh.triangles[s]) marks[v] = 1;
    for (const uint32_t v : mesh.triangles[t]) marks[v] = 1;
  }
  return marks;
}

/// And their neighbours.
Marks widened(const Neighbours& neighbours, const Marks& marks) {
  Marks wider = marks;
  for_each_vertex(marks.size(), [&](size_t v) {
    const auto around = neighbours.of(v);
    if (std::any_of(around.begin(), around.end(), [&](uint32_t n) { return marks[n]; })) {
      wider[v] = 1;
    }
  });
  return wider;
}

/// A step towards the mean of the neighbours.
void smooth(const Neighbours& neighbours, const Marks& marks, Mesh& mesh) {
  std::vector<Vector3f> moved = mesh.vertices;
  for_each_vertex(marks.size(), [&](size_t v) {
    if (marks[v]) moved[v] += 0.5F * internal_force(neighbours, mesh.vertices, v);
  });
  mesh.vertices.swap(moved);
}

void pull_back(const Marks& marks, const std::vector<Vector3f>& start, float part, Mesh& mesh) {
  for_each_vertex(marks.size(), [&](size_t v) {
    if (marks[v]) mesh.vertices[v] += part * (start[v] - mesh.vertices[v]);
  });
}

void settle(const std::optional<VertexLattice>& lattice, const Marks& marks, Mesh& mesh) {
  if (!lattice) return;
  for_each_vertex(mesh.vertices.size(), [&](size_t v) {
    if (marks[v]) mesh.vertices[v] = rounded_to(*lattice, mesh.vertices[v]);
  });
}

std::vector<uint32_t> triangles_at(const Marks& marks, const Mesh& mesh) {
  std::vector<uint32_t> touched;
  for (uint32_t t = 0; t < mesh.triangles.size(); ++t) {
    const auto& [a, b, c] = mesh.triangles[t];
    if (marks[a] || marks[b] || marks[c]) touched.push_back(t);
  }
  return touched;
}

}  // namespace

size_t untangle(const Neighbours& neighbours, const std::vector<Vector3f>& start,
                const std::optional<VertexLattice>& lattice, Mesh& mesh) {
  settle(lattice, Marks(mesh.vertices.size(), 1), mesh);
  std::vector<Crossing> crossings = self_intersections(mesh);
  for (int pass = 0; pass < kUntanglings && !crossings.empty(); ++pass) {
    Marks marks = corners_of(crossings, mesh);
    if (pass < kSmoothings) {
      marks = widened(neighbours, marks);
      for (int i = 0; i < kStepsPerSmoothing; ++i) smooth(neighbours, marks, mesh);
    } else {
      for (int i = kSmoothings; i < pass; ++i) marks = widened(neighbours, marks);
      const bool last = pass + 2 >= kUntanglings;
      pull_back(marks, start, last ? 1.0F : 0.5F, mesh);
    }
    settle(lattice, marks, mesh);
    // Crossings that none of the moved triangles takes part in are gone already.
    crossings = self_intersections(mesh, triangles_at(marks, mesh));
  }
  return crossings.size();
}

}  // namespace v3d
