#include "recon/nearest_triangle.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>

namespace v3d {
namespace {

constexpr int kMostCellsPerAxis = 256;

struct Corners {
  Eigen::Vector3d a, b, c;
};

Corners corners_of(const Mesh& mesh, uint32_t t) {
  const auto& [a, b, c] = mesh.triangles[t];
  return {mesh.vertices[a].cast<double>(), mesh.vertices[b].cast<double>(),
          mesh.vertices[c].cast<double>()};
}

}  // namespace

Eigen::Vector3d nearest_weights(const Eigen::Vector3d& p, const Eigen::Vector3d& a,
                                const Eigen::Vector3d& b, const Eigen::Vector3d& c) {
  const Eigen::Vector3d ab = b - a, ac = c - a;
  const double d1 = ab.dot(p - a), d2 = ac.dot(p - a);
  if (d1 <= 0 && d2 <= 0) {
    return {1, 0, 0};
  }
  const double d3 = ab.dot(p - b), d4 = ac.dot(p - b);
  if (d3 >= 0 && d4 <= d3) {
    return {0, 1, 0};
  }
  const double vc = d1 * d4 - d3 * d2;
  if (vc <= 0 && d1 >= 0 && d3 <= 0 && d1 > d3) {
    const double s = d1 / (d1 - d3);
    return {1 - s, s, 0};
  }
  const double d5 = ab.dot(p - c), d6 = ac.dot(p - c);
  if (d6 >= 0 && d5 <= d6) {
    return {0, 0, 1};
  }
  const double vb = d5 * d2 - d1 * d6;
  if (vb <= 0 && d2 >= 0 && d6 <= 0 && d2 > d6) {
    const double s = d2 / (d2 - d6);
    return {1 - s, 0, s};
  }
  const double va = d3 * d6 - d5 * d4;
  if (va <= 0 && d4 >= d3 && d5 >= d6 && (d4 > d3 || d5 > d6)) {
    const double s = (d4 - d3) / ((d4 - d3) + (d5 - d6));
    return {0, 1 - s, s};
  }
  const double sum = va + vb + vc;
  return sum > 0 ? Eigen::Vector3d(va / sum, vb / sum, vc / sum) : Eigen::Vector3d(1, 0, 0);
}

NearestTriangle::NearestTriangle(const Mesh& mesh) : mesh_(&mesh) {
  if (mesh.triangles.empty()) {
    return;
  }
  Eigen::Vector3d low = Eigen::Vector3d::Constant(std::numeric_limits<double>::max());
  Eigen::Vector3d high = -low;
  double edges = 0;
  for (uint32_t t = 0; t < mesh.triangles.size(); ++t) {
    const Corners at = corners_of(mesh, t);
    low = low.cwiseMin(at.a).cwiseMin(at.b).cwiseMin(at.c);
    high = high.cwiseMax(at.a).cwiseMax(at.b).cwiseMax(at.c);
    edges += (at.b - at.a).norm();
  }
  origin_ = low;
  const double longest = std::max((high - low).maxCoeff(), 1e-9);
  cell_m_ =
      std::max(2 * edges / static_cast<double>(mesh.triangles.size()), longest / kMostCellsPerAxis);
  counts_ = ((high - low) / cell_m_).array().floor().cast<int>() + 1;

  // Two passes over the boxes of the triangles: count, then place.
  begin_.assign(static_cast<size_t>(counts_.cast<int64_t>().prod()) + 1, 0);
  const auto for_each_cell = [&](uint32_t t, auto&& visit) {
    const Corners at = corners_of(mesh, t);
    const Eigen::Vector3i first = cell_of(at.a.cwiseMin(at.b).cwiseMin(at.c));
    const Eigen::Vector3i last = cell_of(at.a.cwiseMax(at.b).cwiseMax(at.c));
    for (int z = first.z(); z <= last.z(); ++z) {
      for (int y = first.y(); y <= last.y(); ++y) {
        for (int x = first.x(); x <= last.x(); ++x) {
          visit(index(x, y, z));
        }
      }
    }
  };
  for (uint32_t t = 0; t < mesh.triangles.size(); ++t) {
    for_each_cell(t, [&](size_t cell) { ++begin_[cell + 1]; });
  }
  for (size_t cell = 1; cell < begin_.size(); ++cell) {
    begin_[cell] += begin_[cell - 1];
  }
  triangles_.resize(begin_.back());
  std::vector<uint32_t> next(begin_.begin(), begin_.end() - 1);
  for (uint32_t t = 0; t < mesh.triangles.size(); ++t) {
    for_each_cell(t, [&](size_t cell) { triangles_[next[cell]++] = t; });
  }
}

Eigen::Vector3i NearestTriangle::cell_of(const Eigen::Vector3d& p) const {
  Eigen::Vector3i cell;
  for (int axis = 0; axis < 3; ++axis) {
    const double position = std::floor((p[axis] - origin_[axis]) / cell_m_);
    cell[axis] = static_cast<int>(std::clamp(position, 0.0, counts_[axis] - 1.0));
  }
  return cell;
}

void NearestTriangle::look_into(int x, int y, int z, const Eigen::Vector3d& p,
                                std::optional<SurfacePoint>& best) const {
  const size_t cell = index(x, y, z);
  for (uint32_t i = begin_[cell]; i < begin_[cell + 1]; ++i) {
    const uint32_t t = triangles_[i];
    const Corners at = corners_of(*mesh_, t);
    const Eigen::Vector3d w = nearest_weights(p, at.a, at.b, at.c);
    const double distance = (p - w.x() * at.a - w.y() * at.b - w.z() * at.c).norm();
    if (!best || distance < best->distance || (distance == best->distance && t < best->triangle)) {
      best = SurfacePoint{distance, t, w};
    }
  }
}

void NearestTriangle::look_at_shell(const Eigen::Vector3i& centre, int radius,
                                    const Eigen::Vector3d& p,
                                    std::optional<SurfacePoint>& best) const {
  const Eigen::Vector3i first = (centre.array() - radius).max(0);
  const Eigen::Vector3i last = (centre.array() + radius).min(counts_.array() - 1);
  for (int z = first.z(); z <= last.z(); ++z) {
    for (int y = first.y(); y <= last.y(); ++y) {
      const bool on_face = std::abs(z - centre.z()) == radius || std::abs(y - centre.y()) == radius;
      for (int x = first.x(); x <= last.x(); ++x) {
        if (on_face || std::abs(x - centre.x()) == radius) {
          look_into(x, y, z, p, best);
        }
      }
    }
  }
}

std::optional<SurfacePoint> NearestTriangle::find(const Eigen::Vector3d& p) const {
  std::optional<SurfacePoint> best;
  if (triangles_.empty()) {
    return best;
  }
  const Eigen::Vector3i centre = cell_of(p);
  // Every cell of shell r is at least (r - 1) cells away from a point in the middle cell, and a
  // point outside the grid is farther still.
  for (int radius = 0; radius <= counts_.maxCoeff(); ++radius) {
    if (best && best->distance < (radius - 1) * cell_m_) {
      break;
    }
    look_at_shell(centre, radius, p, best);
  }
  return best;
}

}  // namespace v3d
