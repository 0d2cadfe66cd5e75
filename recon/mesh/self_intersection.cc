#include "recon/mesh/self_intersection.h"

#include <tbb/enumerable_thread_specific.h>
#include <tbb/parallel_for.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <array>

#include "base/geometry/box.h"

namespace v3d {
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

}  // namespace v3d
