#include "recon/self_intersection.h"

#include <tbb/concurrent_vector.h>
#include <tbb/parallel_for.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>

#include "recon/mesh_edges.h"

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

/// Cubes a little wider than an edge, so that a triangle is in few of them and a cube has few
/// triangles.
class Cells {
 public:
  explicit Cells(const Mesh& mesh) {
    Box3 all;
    for (const Eigen::Vector3f& v : mesh.vertices) all.extend(v);
    first_ = all.min();
    double width = std::max(1.3 * mean_edge(mesh), 1e-9);
    while ((all.sizes().cast<double>().array() / width + 1).prod() > kMost) width *= 1.2;
    per_metre_ = static_cast<float>(1 / width);
    along_ = numbers(all.max()) + 1;
  }
  size_t count() const { return static_cast<size_t>(along_.cast<int64_t>().prod()); }
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
  static constexpr double kMost = 1 << 22;
  Eigen::Array3i numbers(const Eigen::Vector3f& place) const {
    return ((place - first_).array() * per_metre_).cast<int>();
  }
  uint32_t key(const Eigen::Array3i& at) const {
    return static_cast<uint32_t>(at[0] + along_[0] * (at[1] + along_[1] * at[2]));
  }

  Eigen::Vector3f first_;
  float per_metre_ = 1;
  Eigen::Array3i along_{1, 1, 1};
};

using Chosen = std::vector<uint8_t>;  ///< one per triangle

/// The triangles whose boxes touch a cell, rising, one cell after the other.
struct FilledCells {
  std::vector<uint32_t> first;  ///< of each cell, in `triangles`; and the end
  std::vector<uint32_t> triangles;
};

/// The triangles in the cells that chosen ones touch; rising.
std::vector<uint32_t> beside(const Cells& cells, const std::vector<Box3>& boxes,
                             const Chosen& chosen) {
  std::vector<uint8_t> wanted(cells.count(), 0);
  for (uint32_t t = 0; t < chosen.size(); ++t) {
    if (chosen[t]) cells.for_each(boxes[t], [&](uint32_t cell) { wanted[cell] = 1; });
  }
  std::vector<uint8_t> touches(boxes.size(), 0);
  tbb::parallel_for(size_t{0}, boxes.size(), [&](size_t t) {
    cells.for_each(boxes[t], [&](uint32_t cell) { touches[t] |= wanted[cell]; });
  });
  std::vector<uint32_t> found;
  for (uint32_t t = 0; t < touches.size(); ++t) {
    if (touches[t]) found.push_back(t);
  }
  return found;
}

FilledCells fill(const Cells& cells, const std::vector<Box3>& boxes,
                 std::span<const uint32_t> triangles) {
  FilledCells filled;
  filled.first.assign(cells.count() + 2, 0);  // one more: where the next triangle goes, at first
  for (const uint32_t t : triangles) {
    cells.for_each(boxes[t], [&](uint32_t cell) { ++filled.first[cell + 2]; });
  }
  std::partial_sum(filled.first.begin(), filled.first.end(), filled.first.begin());
  filled.triangles.resize(filled.first.back());
  for (const uint32_t t : triangles) {
    cells.for_each(boxes[t],
                   [&](uint32_t cell) { filled.triangles[filled.first[cell + 1]++] = t; });
  }
  filled.first.pop_back();
  return filled;
}

Corners corners_of(const Mesh& mesh, uint32_t t) {
  const auto& [a, b, c] = mesh.triangles[t];
  return {mesh.vertices[a].cast<double>(), mesh.vertices[b].cast<double>(),
          mesh.vertices[c].cast<double>()};
}

std::vector<Crossing> find(const Mesh& mesh, const Chosen& chosen) {
  const Cells cells(mesh);
  std::vector<Box3> boxes(mesh.triangles.size());
  tbb::parallel_for(size_t{0}, boxes.size(),
                    [&](size_t t) { boxes[t] = box_of(mesh, static_cast<uint32_t>(t)); });
  const FilledCells filled = fill(cells, boxes, beside(cells, boxes, chosen));
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
  tbb::parallel_for(uint32_t{0}, static_cast<uint32_t>(cells.count()), [&](uint32_t cell) {
    const uint32_t end = filled.first[cell + 1];
    for (uint32_t i = filled.first[cell]; i < end; ++i) {
      for (uint32_t j = i + 1; j < end; ++j) {
        const uint32_t s = filled.triangles[i], t = filled.triangles[j];
        if (is_crossing(cell, s, t)) found.push_back({s, t});
      }
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
