#include "recon/mesh/self_intersection.h"

#include <tbb/enumerable_thread_specific.h>
#include <tbb/parallel_for.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <array>

#include "base/geometry/rigid_transform.h"
#include "recon/mesh/mesh_neighbours.h"

namespace v3d::recon {
namespace {

using Eigen::Vector3d;
using Corners = std::array<Vector3d, 3>;
using Triangle = std::array<uint32_t, 3>;

/// Number of leaves that one task queries.
constexpr size_t kLeavesInTask = 16;

/// Six times the signed volume of the tetrahedron a, b, c, d. The sign is the side of the plane a,
/// b, c on which d lies.
double side(const Vector3d& a, const Vector3d& b, const Vector3d& c, const Vector3d& d) {
  return (b - a).cross(c - a).dot(d - a);
}

/// side() of three points for the plane of a triangle.
std::array<double, 3> sides(const Corners& t, const Corners& points) {
  return {side(t[0], t[1], t[2], points[0]), side(t[0], t[1], t[2], points[1]),
          side(t[0], t[1], t[2], points[2])};
}

/// True when the line p-q passes through the interior of the triangle.
bool pierces(const Vector3d& p, const Vector3d& q, const Corners& t) {
  const double ab = side(p, q, t[0], t[1]), bc = side(p, q, t[1], t[2]);
  const double ca = side(p, q, t[2], t[0]);
  return (ab > 0 && bc > 0 && ca > 0) || (ab < 0 && bc < 0 && ca < 0);
}

bool cross(const Corners& s, const Corners& t) {
  const std::array<double, 3> s_of_t = sides(t, s), t_of_s = sides(s, t);
  for (int k = 0; k < 3; ++k) {
    const int next = (k + 1) % 3;
    if (s_of_t[k] * s_of_t[next] < 0 && pierces(s[k], s[next], t)) return true;
    if (t_of_s[k] * t_of_s[next] < 0 && pierces(t[k], t[next], s)) return true;
  }
  return false;
}

bool share_vertex(const Triangle& a, const Triangle& b) {
  bool shared = false;  // usually true, so an early exit saves nothing
  for (const uint32_t v : a) shared |= v == b[0] || v == b[1] || v == b[2];
  return shared;
}

BoxTree::Box box_of(const Mesh& mesh, uint32_t t) {
  const auto& [a, b, c] = mesh.triangles[t];
  return BoxTree::Box(mesh.vertices[a]).extend(mesh.vertices[b]).extend(mesh.vertices[c]);
}

std::vector<BoxTree::Box> boxes_of(const Mesh& mesh) {
  std::vector<BoxTree::Box> boxes(mesh.triangles.size());
  tbb::parallel_for(size_t{0}, boxes.size(),
                    [&](size_t t) { boxes[t] = box_of(mesh, static_cast<uint32_t>(t)); });
  return boxes;
}

Corners corners_of(const Mesh& mesh, uint32_t t) {
  const auto& [a, b, c] = mesh.triangles[t];
  return {mesh.vertices[a].cast<double>(), mesh.vertices[b].cast<double>(),
          mesh.vertices[c].cast<double>()};
}

}  // namespace

CrossingFinder::CrossingFinder(const Mesh& mesh) : mesh_(mesh), tree_(boxes_of(mesh)) {}

std::vector<Crossing> CrossingFinder::all() const {
  return find(Chosen(tree_.leaves(), BoxTree::Places{0xFFFF}));
}

std::vector<Crossing> CrossingFinder::of_moved(const std::vector<uint8_t>& moved) {
  Chosen chosen(tree_.leaves(), 0);
  tbb::parallel_for(size_t{0}, chosen.size(), [&](size_t leaf) {
    const auto triangles = tree_.in_leaf(leaf);
    for (size_t place = 0; place < triangles.size(); ++place) {
      const auto& [a, b, c] = mesh_.triangles[triangles[place]];
      if ((moved[a] | moved[b] | moved[c]) == 0) continue;
      chosen[leaf] |= static_cast<BoxTree::Places>(1U << place);
      tree_.replace(leaf, place, box_of(mesh_, triangles[place]));
    }
  });
  tree_.refit();
  return find(chosen);
}

std::vector<Crossing> CrossingFinder::find(const Chosen& chosen) const {
  const auto is_crossing = [&](const BoxTree::Pair& pair) {
    const auto& [s, t] = pair;
    return !share_vertex(mesh_.triangles[s], mesh_.triangles[t]) &&
           cross(corners_of(mesh_, std::min(s, t)), corners_of(mesh_, std::max(s, t)));
  };
  struct Found {
    std::vector<BoxTree::Pair> overlapping;
    std::vector<Crossing> crossings;
  };
  tbb::enumerable_thread_specific<Found> found;
  const size_t tasks = (chosen.size() + kLeavesInTask - 1) / kLeavesInTask;
  tbb::parallel_for(size_t{0}, tasks, [&](size_t task) {
    auto& [overlapping, crossings] = found.local();
    overlapping.clear();
    const size_t end = std::min(chosen.size(), (task + 1) * kLeavesInTask);
    for (size_t leaf = task * kLeavesInTask; leaf < end; ++leaf) {
      if (chosen[leaf] != 0) tree_.overlapping(leaf, chosen, overlapping);
    }
    for (const BoxTree::Pair& pair : overlapping) {
      if (is_crossing(pair)) crossings.emplace_back(std::minmax(pair.first, pair.second));
    }
  });
  std::vector<Crossing> all;
  for (const Found& of_thread : found) {
    all.insert(all.end(), of_thread.crossings.begin(), of_thread.crossings.end());
  }
  std::sort(all.begin(), all.end());
  return all;
}

std::vector<Crossing> self_intersections(const Mesh& mesh) { return CrossingFinder(mesh).all(); }

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

}  // namespace v3d::recon
