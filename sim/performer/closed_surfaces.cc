#include "sim/performer/closed_surfaces.h"

#include <map>
#include <tuple>
#include <utility>

#include "base/core/union_find.h"

namespace v3d::sim {
namespace {

using Eigen::Vector3f;
using Triangles = std::vector<std::array<uint32_t, 3>>;

/// By vertex the first vertex at the same position.
std::vector<uint32_t> first_at_position(std::span<const Vector3f> positions) {
  std::map<std::tuple<float, float, float>, uint32_t> known;
  std::vector<uint32_t> first;
  for (const Vector3f& p : positions) {
    const auto index = static_cast<uint32_t>(first.size());
    first.push_back(known.emplace(std::tuple(p.x(), p.y(), p.z()), index).first->second);
  }
  return first;
}

/// The holes, each as the ring of its vertices in the direction of the triangles. At each vertex as
/// many edges without an opposite edge begin as end, so that rings close.
std::vector<std::vector<uint32_t>> holes_of(const Triangles& triangles) {
  std::map<std::pair<uint32_t, uint32_t>, int> single;  // edges without an opposite edge
  for (const auto& t : triangles) {
    for (size_t k = 0; k < 3; ++k) {
      const uint32_t a = t[k], b = t[(k + 1) % 3];
      const auto opposite = single.find({b, a});
      if (opposite == single.end()) {
        ++single[{a, b}];
      } else if (--opposite->second == 0) {
        single.erase(opposite);
      }
    }
  }
  std::multimap<uint32_t, uint32_t> next;
  for (const auto& [edge, count] : single) {
    for (int n = 0; n < count; ++n) next.insert(edge);
  }
  std::vector<std::vector<uint32_t>> holes;
  while (!next.empty()) {
    std::vector<uint32_t>& ring = holes.emplace_back();
    auto edge = next.begin();
    do {
      ring.push_back(edge->first);
      const uint32_t to = edge->second;
      next.erase(edge);
      edge = to == ring.front() ? next.end() : next.find(to);
    } while (edge != next.end());
  }
  return holes;
}

ClosedSurface closed(const Triangles& triangles) {
  ClosedSurface surface;
  std::map<uint32_t, uint32_t> index;
  for (const auto& triangle : triangles) {
    std::array<uint32_t, 3> corners{};
    for (size_t k = 0; k < 3; ++k) {
      const auto [at, is_new] =
          index.emplace(triangle[k], static_cast<uint32_t>(surface.sources.size()));
      if (is_new) surface.sources.push_back(triangle[k]);
      corners[k] = at->second;
    }
    surface.triangles.push_back(corners);
  }
  surface.holes = holes_of(surface.triangles);
  auto middle = static_cast<uint32_t>(surface.sources.size());
  for (const std::vector<uint32_t>& ring : surface.holes) {
    for (size_t k = 0; k < ring.size(); ++k) {
      surface.triangles.push_back({ring[(k + 1) % ring.size()], ring[k], middle});
    }
    ++middle;
  }
  return surface;
}

}  // namespace

void ClosedSurface::add_middles(std::vector<Vector3f>& values) const {
  for (const std::vector<uint32_t>& ring : holes) {
    Vector3f sum = Vector3f::Zero();
    for (const uint32_t v : ring) sum += values[v];
    values.push_back(sum / static_cast<float>(ring.size()));
  }
}

std::vector<ClosedSurface> closed_surfaces(std::span<const Vector3f> positions,
                                           std::span<const std::array<uint32_t, 3>> triangles) {
  const std::vector<uint32_t> first = first_at_position(positions);
  Triangles welded;
  UnionFind sets;
  sets.reset(positions.size());
  for (const auto& t : triangles) {
    const std::array<uint32_t, 3> corners = {first[t[0]], first[t[1]], first[t[2]]};
    const auto [a, b, c] = corners;
    if (a == b || b == c || c == a) continue;
    sets.unite(a, b);
    sets.unite(b, c);
    welded.push_back(corners);
  }
  std::map<uint32_t, Triangles> connected;
  for (const auto& triangle : welded) connected[sets.find(triangle[0])].push_back(triangle);
  std::vector<ClosedSurface> surfaces;
  for (const auto& [set, own] : connected) surfaces.push_back(closed(own));
  return surfaces;
}

}  // namespace v3d::sim
