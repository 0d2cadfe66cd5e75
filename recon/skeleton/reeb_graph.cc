#include "recon/skeleton/reeb_graph.h"

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "base/core/error.h"
#include "recon/skeleton/vertex_graph.h"

namespace v3d::recon {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

constexpr auto kNone = ReebNode::kNoParent;
using Edges = std::vector<std::array<uint32_t, 2>>;

/// Sums over the surface of a node.
struct Moments {
  double area = 0, volume = 0;
  Vector3d first = Vector3d::Zero();
  Matrix3d second = Matrix3d::Zero();

  void add(double of_area, const Vector3d& position) {
    area += of_area;
    first += of_area * position;
    second += of_area * position * position.transpose();
  }
  void add(const Moments& other) {
    area += other.area;
    volume += other.volume;
    first += other.first;
    second += other.second;
  }
  Vector3d centre() const { return area > 0 ? Vector3d(first / area) : Vector3d(Vector3d::Zero()); }
  Vector3d extent() const {
    if (area <= 0) return Vector3d::Zero();
    const Vector3d mean = centre();
    const Eigen::SelfAdjointEigenSolver<Matrix3d> solver(second / area - mean * mean.transpose(),
                                                         Eigen::EigenvaluesOnly);
    return solver.eigenvalues().cwiseMax(0).cwiseSqrt().reverse();
  }
};

/// Numbers connected groups of equal keys.
class Groups {
 public:
  Groups(size_t count) : parent_(count) {
    for (uint32_t i = 0; i < count; ++i) parent_[i] = i;
  }
  uint32_t find(uint32_t i) {
    while (parent_[i] != i) i = parent_[i] = parent_[parent_[i]];
    return i;
  }
  void join(uint32_t a, uint32_t b) {
    a = find(a);
    b = find(b);
    parent_[std::max(a, b)] = std::min(a, b);
  }
  /// Number of the group of each entry, in the order of first entries.
  std::vector<uint32_t> numbers() {
    std::vector<uint32_t> number(parent_.size());
    uint32_t count = 0;
    for (uint32_t i = 0; i < parent_.size(); ++i) {
      number[i] = find(i) == i ? count++ : number[find(i)];
    }
    return number;
  }

 private:
  std::vector<uint32_t> parent_;
};

void sort_unique(Edges& edges) {
  std::ranges::sort(edges);
  edges.erase(std::unique(edges.begin(), edges.end()), edges.end());
}

struct BuiltLevel {
  ReebLevel level;
  std::vector<Moments> moments;
};

class Builder {
 public:
  Builder(const Mesh& mesh, size_t levels)
      : mesh_(mesh), finest_(static_cast<uint32_t>(levels - 1)), graph_(mesh) {}

  ReebGraph build(const GeodesicOptions& options) {
    ReebGraph result;
    integral_ = geodesic_integral(mesh_, graph_, options);
    result.node_of.assign(mesh_.vertices.size(), kNone);
    if (integral_.components == 0) return result;
    std::vector<BuiltLevel> levels(finest_ + 1);
    build_finest(levels[finest_], result.node_of);
    for (uint32_t level = finest_; level > 0; --level) coarsen(levels[level], levels[level - 1]);
    finish(levels, result);
    return result;
  }

 private:
  uint32_t interval(size_t vertex) const {
    const auto count = static_cast<float>(1U << finest_);
    const float number = std::floor(integral_.normalised[vertex] * count);
    return static_cast<uint32_t>(std::clamp(number, 0.0F, count - 1));
  }

  void build_finest(BuiltLevel& built, std::vector<uint32_t>& node_of) {
    Groups groups(mesh_.vertices.size());
    std::vector<uint32_t> intervals(mesh_.vertices.size());
    for (uint32_t v = 0; v < intervals.size(); ++v) intervals[v] = interval(v);
    for (uint32_t v = 0; v < intervals.size(); ++v) {
      for (const VertexGraph::Link& link : graph_.of(v)) {
        if (intervals[v] == intervals[link.to]) groups.join(v, link.to);
      }
    }
    std::vector<uint32_t> number(intervals.size(), kNone);
    for (uint32_t v = 0; v < intervals.size(); ++v) {
      if (integral_.component[v] == kNone) continue;
      uint32_t& node = number[groups.find(v)];
      if (node == kNone) {
        node = static_cast<uint32_t>(built.level.nodes.size());
        built.level.nodes.push_back({.interval = intervals[v],
                                     .component = integral_.component[v],
                                     .low_m = integral_.metres[v],
                                     .high_m = integral_.metres[v]});
      }
      ReebNode& of_vertex = built.level.nodes[node];
      of_vertex.low_m = std::min(of_vertex.low_m, double{integral_.metres[v]});
      of_vertex.high_m = std::max(of_vertex.high_m, double{integral_.metres[v]});
      node_of[v] = node;
    }
    join_nodes(node_of, built.level.edges);
    measure(node_of, built);
  }

  void join_nodes(const std::vector<uint32_t>& node_of, Edges& edges) const {
    for (uint32_t v = 0; v < node_of.size(); ++v) {
      for (const VertexGraph::Link& link : graph_.of(v)) {
        const uint32_t a = node_of[v], b = node_of[link.to];
        if (a < b) edges.push_back({a, b});
      }
    }
    sort_unique(edges);
  }

  void measure(const std::vector<uint32_t>& node_of, BuiltLevel& built) const {
    built.moments.assign(built.level.nodes.size(), {});
    const std::vector<double> areas = vertex_areas(mesh_);
    for (size_t v = 0; v < areas.size(); ++v) {
      if (node_of[v] == kNone) continue;
      built.moments[node_of[v]].add(areas[v], mesh_.vertices[v].cast<double>());
    }
    std::vector<Vector3d> centres(built.moments.size());
    std::ranges::transform(built.moments, centres.begin(), &Moments::centre);
    for (const auto& triangle : mesh_.triangles) {
      const auto at = [&](size_t corner) {
        return mesh_.vertices[triangle[corner]].cast<double>();
      };
      const Vector3d twice = (at(1) - at(0)).cross(at(2) - at(0));
      for (size_t corner = 0; corner < 3; ++corner) {
        const uint32_t node = node_of[triangle[corner]];
        if (node != kNone) built.moments[node].volume += twice.dot(at(corner) - centres[node]) / 18;
      }
    }
    for (Moments& moments : built.moments) moments.volume = std::max(moments.volume, 0.0);
  }

  void coarsen(BuiltLevel& fine, BuiltLevel& coarse) const {
    std::vector<ReebNode>& nodes = fine.level.nodes;
    Groups groups(nodes.size());
    for (const auto& [a, b] : fine.level.edges) {
      if (nodes[a].interval / 2 == nodes[b].interval / 2) groups.join(a, b);
    }
    const std::vector<uint32_t> parents = groups.numbers();
    for (size_t n = 0; n < nodes.size(); ++n) {
      nodes[n].parent = parents[n];
      if (parents[n] == coarse.level.nodes.size()) {
        ReebNode node = nodes[n];
        node.interval /= 2;
        node.parent = kNone;
        coarse.level.nodes.push_back(node);
        coarse.moments.emplace_back();
      }
      ReebNode& parent = coarse.level.nodes[parents[n]];
      parent.low_m = std::min(parent.low_m, nodes[n].low_m);
      parent.high_m = std::max(parent.high_m, nodes[n].high_m);
      coarse.moments[parents[n]].add(fine.moments[n]);
    }
    for (const auto& [a, b] : fine.level.edges) {
      const auto [low, high] = std::minmax(parents[a], parents[b]);
      if (low != high) coarse.level.edges.push_back({low, high});
    }
    sort_unique(coarse.level.edges);
  }

  static void finish(std::vector<BuiltLevel>& levels, ReebGraph& result) {
    Moments all;
    for (const Moments& moments : levels.back().moments) all.add(moments);
    result.area_m2 = all.area;
    result.volume_m3 = all.volume;
    result.centre = all.centre();
    for (BuiltLevel& built : levels) {
      for (size_t n = 0; n < built.moments.size(); ++n) {
        ReebNode& node = built.level.nodes[n];
        const Moments& moments = built.moments[n];
        node.area = all.area > 0 ? moments.area / all.area : 0;
        node.volume = all.volume > 0 ? moments.volume / all.volume : node.area;
        node.centre = moments.centre();
        node.extent = moments.extent();
        const double range = node.high_m - node.low_m;
        node.perimeter = range > 0 ? moments.area / range : 0;
      }
      result.levels.push_back(std::move(built.level));
    }
  }

  const Mesh& mesh_;
  const uint32_t finest_;
  const VertexGraph graph_;
  GeodesicIntegral integral_;
};

}  // namespace

ReebGraph reeb_graph(const Mesh& mesh, const ReebOptions& options) {
  V3D_CHECK(options.levels >= 1 && options.levels <= 16);
  return Builder(mesh, options.levels).build(options.geodesic);
}

}  // namespace v3d::recon
