#include "recon/self_intersection.h"

#include <tbb/concurrent_vector.h>
#include <tbb/parallel_for.h>
#include <tbb/parallel_sort.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>

namespace v3d {
namespace {

using Eigen::Vector3d;
using Corners = std::array<Vector3d, 3>;
using Box3 = Eigen::AlignedBox3f;
using Triangle = std::array<uint32_t, 3>;

/// Which side of the plane of a, b, c the point d is on, times six volumes.
double side(const Vector3d& a, const Vector3d& b, const Vector3d& c, const Vector3d& d) {
  return (b - a).cross(c - a).dot(d - a);
}

/// The edge p-q goes through the inside of the triangle.
bool pierces(const Vector3d& p, const Vector3d& q, const Corners& t) {
  const double from = side(t[0], t[1], t[2], p), to = side(t[0], t[1], t[2], q);
  if (!(from * to < 0)) return false;
  const double ab = side(p, q, t[0], t[1]), bc = side(p, q, t[1], t[2]);
  const double ca = side(p, q, t[2], t[0]);
  return (ab > 0 && bc > 0 && ca > 0) || (ab < 0 && bc < 0 && ca < 0);
}

bool cross(const Corners& s, const Corners& t) {
  for (int k = 0; k < 3; ++k) {
    if (pierces(s[k], s[(k + 1) % 3], t) || pierces(t[k], t[(k + 1) % 3], s)) return true;
  }
  return false;
}

bool share_vertex(const Triangle& a, const Triangle& b) {
  return std::any_of(a.begin(), a.end(),
                     [&](uint32_t v) { return std::find(b.begin(), b.end(), v) != b.end(); });
}

Box3 box_of(const Mesh& mesh, uint32_t t) {
  const auto& [a, b, c] = mesh.triangles[t];
  return Box3(mesh.vertices[a]).extend(mesh.vertices[b]).extend(mesh.vertices[c]);
}

/// Cubes about two edges wide, so that a triangle is in few of them and a cube has few triangles.
class Cells {
 public:
  explicit Cells(const Mesh& mesh) {
    double edges = 0;
    for (const auto& [a, b, c] : mesh.triangles) {
      edges += (mesh.vertices[a] - mesh.vertices[b]).norm();
    }
    for (const Eigen::Vector3f& v : mesh.vertices) all_.extend(v);
    const double mean = edges / static_cast<double>(mesh.triangles.size());
    width_ = static_cast<float>(
        std::max(2 * mean, double{all_.sizes().maxCoeff()} / (kMostPerAxis - 2) + 1e-9));
  }
  uint32_t at(const Eigen::Vector3f& place) const { return key(numbers(place)); }
  template <class Visit>
  void for_each(const Box3& box, const Visit& visit) const {
    const Eigen::Array3i low = numbers(box.min()), high = numbers(box.max());
    Eigen::Array3i at;
    for (at[2] = low[2]; at[2] <= high[2]; ++at[2]) {
      for (at[1] = low[1]; at[1] <= high[1]; ++at[1]) {
        for (at[0] = low[0]; at[0] <= high[0]; ++at[0]) visit(key(at));
      }
    }
  }

 private:
  static constexpr int kMostPerAxis = 1 << 10;
  Eigen::Array3i numbers(const Eigen::Vector3f& place) const {
    return ((place - all_.min()).array() / width_).cast<int>();
  }
  static uint32_t key(const Eigen::Array3i& at) {
    return static_cast<uint32_t>(at[0] + kMostPerAxis * (at[1] + kMostPerAxis * at[2]));
  }

  Box3 all_;
  float width_ = 1;
};

/// A cell and one of the triangles whose boxes touch it; sorted, cells stand together.
using Entry = uint64_t;
Entry entry(uint32_t cell, uint32_t triangle) { return uint64_t{cell} << 32 | triangle; }
uint32_t cell_of(Entry e) { return static_cast<uint32_t>(e >> 32); }
uint32_t triangle_of(Entry e) { return static_cast<uint32_t>(e); }

using Chosen = std::vector<uint8_t>;  ///< one per triangle

/// What is in the cells that chosen triangles touch; cell by cell.
std::vector<Entry> fill(const Cells& cells, const std::vector<Box3>& boxes, const Chosen& chosen) {
  std::vector<uint32_t> wanted;
  const bool all = std::find(chosen.begin(), chosen.end(), 0) == chosen.end();
  for (uint32_t t = 0; t < chosen.size() && !all; ++t) {
    if (chosen[t]) cells.for_each(boxes[t], [&](uint32_t cell) { wanted.push_back(cell); });
  }
  std::sort(wanted.begin(), wanted.end());
  wanted.erase(std::unique(wanted.begin(), wanted.end()), wanted.end());
  std::vector<Entry> entries;
  for (uint32_t t = 0; t < chosen.size(); ++t) {
    cells.for_each(boxes[t], [&](uint32_t cell) {
      if (all || std::binary_search(wanted.begin(), wanted.end(), cell)) {
        entries.push_back(entry(cell, t));
      }
    });
  }
  tbb::parallel_sort(entries);
  return entries;
}

Corners corners_of(const Mesh& mesh, uint32_t t) {
  const auto& [a, b, c] = mesh.triangles[t];
  return {mesh.vertices[a].cast<double>(), mesh.vertices[b].cast<double>(),
          mesh.vertices[c].cast<double>()};
}

std::vector<Crossing> find(const Mesh& mesh, const Chosen& chosen) {
  const Cells cells(mesh);
  std::vector<Box3> boxes(mesh.triangles.size());
  for (uint32_t t = 0; t < boxes.size(); ++t) boxes[t] = box_of(mesh, t);
  const std::vector<Entry> entries = fill(cells, boxes, chosen);
  const auto is_crossing = [&](uint32_t cell, uint32_t s, uint32_t t) {
    if ((!chosen[s] && !chosen[t]) || !boxes[s].intersects(boxes[t]) ||
        share_vertex(mesh.triangles[s], mesh.triangles[t])) {
      return false;
    }
    // Of the cells that both are in, that of the lowest corner of what their boxes share.
    return cells.at(boxes[s].min().cwiseMax(boxes[t].min())) == cell &&
           cross(corners_of(mesh, s), corners_of(mesh, t));
  };
  tbb::concurrent_vector<Crossing> found;
  tbb::parallel_for(size_t{0}, entries.size(), [&](size_t i) {
    const uint32_t cell = cell_of(entries[i]), s = triangle_of(entries[i]);
    for (size_t j = i + 1; j < entries.size() && cell_of(entries[j]) == cell; ++j) {
      const uint32_t t = triangle_of(entries[j]);
      if (is_crossing(cell, s, t)) found.push_back({s, t});
    }
  });
  std::vector<Crossing> all(found.begin(), found.end());
  std::sort(all.begin(), all.end());
  return all;
}

}  // namespace

std::vector<Crossing> self_intersections(const Mesh& mesh) {
  if (mesh.triangles.empty()) return {};
  return find(mesh, Chosen(mesh.triangles.size(), 1));
}

std::vector<Crossing> self_intersections(const Mesh& mesh, std::span<const uint32_t> among) {
  if (mesh.triangles.empty()) return {};
  Chosen chosen(mesh.triangles.size(), 0);
  for (const uint32_t t : among) chosen[t] = 1;
  return find(mesh, chosen);
}

}  // namespace v3d
