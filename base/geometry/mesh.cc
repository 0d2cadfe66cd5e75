#include "base/geometry/mesh.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cstddef>
#include <iterator>

#include "base/core/union_find.h"

namespace v3d {
namespace {

using Edge = std::pair<uint32_t, uint32_t>;

/// All directed edges, sorted.
std::vector<Edge> directed_edges(const Mesh& mesh) {
  std::vector<Edge> edges;
  edges.reserve(mesh.triangles.size() * 3);
  for (const auto& t : mesh.triangles) {
    for (int i = 0; i < 3; ++i) {
      edges.emplace_back(t[i], t[(i + 1) % 3]);
    }
  }
  std::sort(edges.begin(), edges.end());
  return edges;
}

}  // namespace

std::vector<Eigen::Vector3f> vertex_normals(const Mesh& mesh) {
  std::vector<Eigen::Vector3f> normals(mesh.vertices.size(), Eigen::Vector3f::Zero());
  for (const auto& t : mesh.triangles) {
    const Eigen::Vector3f& a = mesh.vertices[t[0]];
    const Eigen::Vector3f area_normal = (mesh.vertices[t[1]] - a).cross(mesh.vertices[t[2]] - a);
    for (const uint32_t v : t) {
      normals[v] += area_normal;
    }
  }
  for (Eigen::Vector3f& n : normals) {
    const float length = n.norm();
    if (length > 0) {
      n /= length;
    }
  }
  return normals;
}

double enclosed_volume(const Mesh& mesh) {
  double six_volumes = 0;
  for (const auto& t : mesh.triangles) {
    const Eigen::Vector3d a = mesh.vertices[t[0]].cast<double>();
    const Eigen::Vector3d b = mesh.vertices[t[1]].cast<double>();
    const Eigen::Vector3d c = mesh.vertices[t[2]].cast<double>();
    six_volumes += a.dot(b.cross(c));
  }
  return six_volumes / 6;
}

bool is_watertight(const Mesh& mesh) {
  const std::vector<Edge> edges = directed_edges(mesh);
  if (std::adjacent_find(edges.begin(), edges.end()) != edges.end()) {
    return false;
  }
  return std::all_of(edges.begin(), edges.end(), [&](const Edge& e) {
    return e.first != e.second &&
           std::binary_search(edges.begin(), edges.end(), Edge{e.second, e.first});
  });
}

bool is_manifold(const Mesh& mesh) {
  if (!is_watertight(mesh)) {
    return false;
  }
  // Two corners at a vertex belong to the same fan when their triangles share an edge at the
  // vertex. In a watertight mesh, the neighbour of the corner after directed edge (v, w) is the
  // corner of the triangle with (w, v).
  struct Corner {
    uint32_t vertex, next, previous;
  };
  std::vector<Corner> corners;
  corners.reserve(mesh.triangles.size() * 3);
  for (const auto& t : mesh.triangles) {
    for (int i = 0; i < 3; ++i) {
      corners.push_back({t[i], t[(i + 1) % 3], t[(i + 2) % 3]});
    }
  }
  std::sort(corners.begin(), corners.end(), [](const Corner& a, const Corner& b) {
    return a.vertex != b.vertex ? a.vertex < b.vertex : a.next < b.next;
  });
  for (size_t begin = 0, end = 0; begin < corners.size(); begin = end) {
    while (end < corners.size() && corners[end].vertex == corners[begin].vertex) {
      ++end;
    }
    const auto first = corners.begin() + static_cast<std::ptrdiff_t>(begin);
    const auto last = corners.begin() + static_cast<std::ptrdiff_t>(end);
    // Walk the fan from its first corner: each neighbour starts at the last edge of the previous
    // one.
    size_t walked = 0;
    uint32_t next = first->next;
    do {
      const auto corner = std::lower_bound(
          first, last, next, [](const Corner& c, uint32_t value) { return c.next < value; });
      next = corner->previous;
      ++walked;
    } while (next != first->next && walked <= end - begin);
    if (walked != end - begin) {
      return false;
    }
  }
  return true;
}

int connected_components(const Mesh& mesh) {
  UnionFind sets;
  sets.reset(mesh.vertices.size());
  std::vector<bool> used(mesh.vertices.size(), false);
  int components = 0;
  for (const auto& t : mesh.triangles) {
    for (const uint32_t v : t) {
      components += used[v] ? 0 : 1;
      used[v] = true;
    }
    components -= sets.unite(t[0], t[1]) ? 1 : 0;
    components -= sets.unite(t[1], t[2]) ? 1 : 0;
  }
  return components;
}

Mesh largest_component(const Mesh& mesh) {
  UnionFind sets;
  sets.reset(mesh.vertices.size());
  for (const auto& t : mesh.triangles) {
    sets.unite(t[0], t[1]);
    sets.unite(t[1], t[2]);
  }
  std::vector<size_t> triangles(mesh.vertices.size(), 0);
  for (const auto& t : mesh.triangles) ++triangles[sets.find(t[0])];
  const auto largest =
      static_cast<uint32_t>(std::ranges::max_element(triangles) - triangles.begin());
  Mesh component{mesh.vertices, {}, mesh.colours};
  std::ranges::copy_if(mesh.triangles, std::back_inserter(component.triangles),
                       [&](const auto& t) { return sets.find(t[0]) == largest; });
  return component;
}

}  // namespace v3d
