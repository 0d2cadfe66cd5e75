#include "recon/self_intersection.h"

#include <tbb/parallel_for.h>
#include <tbb/parallel_sort.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <vector>

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

/// A triangle in one of the cells of a lattice that its box touches.
struct Entry {
  uint64_t cell;
  uint32_t triangle;
  friend auto operator<=>(const Entry&, const Entry&) = default;
};

/// Cells about two edges wide, so that a triangle is in few of them and a cell has few triangles.
class CellList {
 public:
  CellList(const Mesh& mesh, const std::vector<Box3>& boxes) {
    double edges = 0;
    for (const auto& [a, b, c] : mesh.triangles) {
      edges += (mesh.vertices[a] - mesh.vertices[b]).norm();
      all_.extend(mesh.vertices[a]).extend(mesh.vertices[b]).extend(mesh.vertices[c]);
    }
    const double mean = edges / static_cast<double>(boxes.size());
    // No more than 2^20 cells along an axis, so that three numbers fit in one.
    width_ = static_cast<float>(std::max(2 * mean, all_.sizes().maxCoeff() / double{1 << 20}));
    for (uint32_t t = 0; t < boxes.size(); ++t) add(t, boxes[t]);
    tbb::parallel_sort(entries_);
  }
  const std::vector<Entry>& entries() const { return entries_; }
  uint64_t cell_of(const Eigen::Vector3f& place) const {
    const Eigen::Array3i at = numbers(place);
    return static_cast<uint64_t>(at[2]) << 42 | static_cast<uint64_t>(at[1]) << 21 |
           static_cast<uint64_t>(at[0]);
  }

 private:
  Eigen::Array3i numbers(const Eigen::Vector3f& place) const {
    return ((place - all_.min()).array() / width_).cast<int>();
  }
  void add(uint32_t triangle, const Box3& box) {
    const Eigen::Array3i low = numbers(box.min()), high = numbers(box.max());
    for (int z = low[2]; z <= high[2]; ++z) {
      for (int y = low[1]; y <= high[1]; ++y) {
        for (int x = low[0]; x <= high[0]; ++x) {
          entries_.push_back({static_cast<uint64_t>(z) << 42 | static_cast<uint64_t>(y) << 21 |
                                  static_cast<uint64_t>(x),
                              triangle});
        }
      }
    }
  }

  Box3 all_;
  float width_ = 1;
  std::vector<Entry> entries_;
};

}  // namespace

int64_t count_self_intersections(const Mesh& mesh) {
  if (mesh.triangles.empty()) return 0;
  std::vector<Box3> boxes;
  for (const auto& [a, b, c] : mesh.triangles) {
    boxes.push_back(Box3(mesh.vertices[a]).extend(mesh.vertices[b]).extend(mesh.vertices[c]));
  }
  const CellList cells(mesh, boxes);
  const std::vector<Entry>& entries = cells.entries();
  const auto corners = [&](uint32_t t) {
    const auto& [a, b, c] = mesh.triangles[t];
    return Corners{mesh.vertices[a].cast<double>(), mesh.vertices[b].cast<double>(),
                   mesh.vertices[c].cast<double>()};
  };
  std::atomic<int64_t> crossings = 0;
  tbb::parallel_for(size_t{0}, entries.size(), [&](size_t i) {
    for (size_t j = i + 1; j < entries.size() && entries[j].cell == entries[i].cell; ++j) {
      const uint32_t s = entries[i].triangle, t = entries[j].triangle;
      const Box3 both = boxes[s].intersection(boxes[t]);
      if (both.isEmpty() || share_vertex(mesh.triangles[s], mesh.triangles[t])) continue;
      // Of the cells that both are in, the one with the lowest corner of what their boxes share.
      if (cells.cell_of(both.min()) == entries[i].cell && cross(corners(s), corners(t))) {
        ++crossings;
      }
    }
  });
  return crossings;
}

}  // namespace v3d
