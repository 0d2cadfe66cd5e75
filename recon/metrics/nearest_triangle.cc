#include "recon/metrics/nearest_triangle.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <numeric>
#include <random>
#include <utility>

namespace v3d::recon {
namespace {

constexpr uint32_t kLeafTriangles = 4;

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
  const auto count = static_cast<uint32_t>(mesh.triangles.size());
  if (count == 0) {
    return;
  }
  order_.resize(count);
  std::iota(order_.begin(), order_.end(), 0U);
  std::vector<Eigen::Vector3f> middles;
  middles.reserve(count);
  for (const auto& [a, b, c] : mesh.triangles) {
    middles.push_back((mesh.vertices[a] + mesh.vertices[b] + mesh.vertices[c]) / 3);
  }
  nodes_.reserve(count);
  build(0, count, middles);
}

/// Builds the nodes of a range of triangles: splits at the median along the longest side. Returns
/// the index of the new node.
uint32_t NearestTriangle::build(uint32_t begin, uint32_t end,
                                const std::vector<Eigen::Vector3f>& middles) {
  const auto self = static_cast<uint32_t>(nodes_.size());
  Node& node = nodes_.emplace_back();
  node.begin = begin;
  node.end = end;
  for (uint32_t i = begin; i < end; ++i) {
    for (const uint32_t v : mesh_->triangles[order_[i]]) {
      node.box.extend(mesh_->vertices[v]);
    }
  }
  if (end - begin > kLeafTriangles) {
    Eigen::Index axis = 0;
    node.box.sizes().maxCoeff(&axis);
    const uint32_t middle = begin + (end - begin) / 2;
    std::nth_element(order_.begin() + begin, order_.begin() + middle, order_.begin() + end,
                     [&](uint32_t s, uint32_t t) {
                       return std::pair(middles[s][axis], s) < std::pair(middles[t][axis], t);
                     });
    build(begin, middle, middles);
    const uint32_t right = build(middle, end, middles);
    nodes_[self].right = right;  // `node` may have moved
  }
  return self;
}

void NearestTriangle::search_leaf(const Node& leaf, const Eigen::Vector3d& p,
                                  std::optional<SurfacePoint>& best) const {
  for (uint32_t i = leaf.begin; i < leaf.end; ++i) {
    const uint32_t t = order_[i];
    const Corners at = corners_of(*mesh_, t);
    const Eigen::Vector3d w = nearest_weights(p, at.a, at.b, at.c);
    const double distance = (p - w.x() * at.a - w.y() * at.b - w.z() * at.c).norm();
    if (!best || distance < best->distance || (distance == best->distance && t < best->triangle)) {
      best = SurfacePoint{distance, t, w};
    }
  }
}

std::optional<SurfacePoint> NearestTriangle::find(const Eigen::Vector3d& p) const {
  std::optional<SurfacePoint> best;
  if (nodes_.empty()) {
    return best;
  }
  const auto distance_to = [&](uint32_t n) {
    return nodes_[n].box.cast<double>().exteriorDistance(p);
  };
  // Each level halves the number of triangles, so the tree is never deeper than this.
  std::array<std::pair<double, uint32_t>, 64> stack;
  size_t depth = 0;
  stack[depth++] = {distance_to(0), 0};
  while (depth > 0) {
    const auto [distance, n] = stack[--depth];
    if (best && distance > best->distance) {
      continue;
    }
    const Node& node = nodes_[n];
    if (node.right == 0) {
      search_leaf(node, p, best);
      continue;
    }
    std::pair<double, uint32_t> near{distance_to(n + 1), n + 1};
    std::pair<double, uint32_t> far{distance_to(node.right), node.right};
    if (far.first < near.first) {
      std::swap(near, far);
    }
    stack[depth++] = far;
    stack[depth++] = near;
  }
  return best;
}

namespace {

/// Cumulative area of the triangles, by triangle.
std::vector<double> cumulative_area(const Mesh& mesh) {
  std::vector<double> area(mesh.triangles.size());
  double sum = 0;
  for (size_t t = 0; t < area.size(); ++t) {
    const auto& [a, b, c] = mesh.triangles[t];
    const Eigen::Vector3d ab = (mesh.vertices[b] - mesh.vertices[a]).cast<double>();
    const Eigen::Vector3d ac = (mesh.vertices[c] - mesh.vertices[a]).cast<double>();
    sum += 0.5 * ab.cross(ac).norm();
    area[t] = sum;
  }
  return area;
}

}  // namespace

Eigen::Vector3d interpolated(const Mesh& mesh, const std::vector<Eigen::Vector3f>& values,
                             uint32_t triangle, const Eigen::Vector3d& weights) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (int k = 0; k < 3; ++k) {
    sum += weights[k] * values[mesh.triangles[triangle][k]].cast<double>();
  }
  return sum;
}

// The C++ standard does not define the results of its distributions, only those of the engine. So
// the distributions are computed here.
std::vector<SurfaceSample> sample_surface(const Mesh& mesh, int samples, uint64_t seed) {
  std::vector<SurfaceSample> spread;
  const std::vector<double> area = cumulative_area(mesh);
  if (area.empty() || !(area.back() > 0)) {
    return spread;
  }
  const std::vector<Eigen::Vector3f> normals = vertex_normals(mesh);
  std::mt19937_64 engine(seed);
  const auto uniform = [&] { return static_cast<double>(engine() >> 11) * 0x1p-53; };
  spread.reserve(samples);
  for (int i = 0; i < samples; ++i) {
    const double target = (i + uniform()) / samples * area.back();
    const auto found = std::upper_bound(area.begin(), area.end(), target);
    const auto t =
        static_cast<uint32_t>(std::min<ptrdiff_t>(found - area.begin(), std::ssize(area) - 1));
    const double r = std::sqrt(uniform()), s = uniform();
    const Eigen::Vector3d weights(1 - r, r * (1 - s), r * s);
    spread.push_back({interpolated(mesh, mesh.vertices, t, weights),
                      interpolated(mesh, normals, t, weights).normalized()});
  }
  return spread;
}

}  // namespace v3d::recon
