#include "recon/skeleton/reeb_graph.h"

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>

#include "base/core/error.h"
#include "base/core/statistics.h"

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

namespace {

constexpr double kMinArea = 0.0002;  ///< of a node
constexpr double kWidening = 1.6;    ///< of the perimeter at the end of a slender part

/// Nodes by the branch that they belong to: sweeps from high values of the integral to low ones.
class Sweep {
 public:
  explicit Sweep(const ReebLevel& level) : level_(level), around_(level.nodes.size()) {
    for (const auto& [a, b] : level.edges) {
      around_[a].push_back(b);
      around_[b].push_back(a);
    }
    branch_of_.assign(level.nodes.size(), kNone);
  }

  void run() {
    std::vector<uint32_t> order(level_.nodes.size());
    std::iota(order.begin(), order.end(), 0U);
    const auto high = [&](uint32_t n) { return level_.nodes[n].high_m; };
    std::ranges::sort(order, [&](uint32_t a, uint32_t b) {
      return high(a) != high(b) ? high(a) > high(b) : a < b;
    });
    for (const uint32_t node : order) {
      if (level_.nodes[node].area >= kMinArea) visit(node);
    }
  }

  struct Branch {
    std::vector<uint32_t> nodes;  ///< all, from high to low
    uint32_t elder = kNone;       ///< the branch that it meets
    double low_m = 0;             ///< where
  };
  const std::vector<Branch>& branches() const { return branches_; }

 private:
  uint32_t eldest(uint32_t branch) const {
    while (branches_[branch].elder != kNone) branch = branches_[branch].elder;
    return branch;
  }

  void visit(uint32_t node) {
    uint32_t joined = kNone;
    for (const uint32_t other : around_[node]) {
      if (branch_of_[other] == kNone) continue;
      const uint32_t branch = eldest(branch_of_[other]);
      if (joined == kNone || branch == joined) {
        joined = branch;
        continue;
      }
      const auto [elder, younger] = std::minmax(joined, branch);  // the end of the first is higher
      branches_[younger].elder = elder;
      branches_[younger].low_m = level_.nodes[node].high_m;
      joined = elder;
    }
    if (joined == kNone) {
      joined = static_cast<uint32_t>(branches_.size());
      branches_.emplace_back();
    }
    branches_[joined].nodes.push_back(node);
    if (branches_[joined].elder == kNone) branches_[joined].low_m = level_.nodes[node].low_m;
    branch_of_[node] = joined;
  }

  const ReebLevel& level_;
  std::vector<std::vector<uint32_t>> around_;
  std::vector<uint32_t> branch_of_;
  std::vector<Branch> branches_;
};

/// Of three nodes from one on: the perimeter of a single node is noisy.
double narrowest(const ReebLevel& level, const GraphBranch& branch, size_t first) {
  double least = level.nodes[branch.nodes[first]].perimeter;
  for (size_t i = first + 1; i < std::min(first + 3, branch.nodes.size()); ++i) {
    least = std::min(least, level.nodes[branch.nodes[i]].perimeter);
  }
  return least;
}

void measure_slender(const ReebLevel& level, const std::vector<size_t>& divided,
                     GraphBranch& branch) {
  std::vector<double> perimeters;
  for (size_t i = 0; i < branch.nodes.size(); ++i) {
    const ReebNode& node = level.nodes[branch.nodes[i]];
    if (divided[i] > 1) break;
    if (i > 3 && narrowest(level, branch, i) > kWidening * upper_median(perimeters)) break;
    if (i > 0) {
      const ReebNode& last = level.nodes[branch.nodes[i - 1]];
      branch.slender_length_m += (node.centre - last.centre).norm();
    }
    perimeters.push_back(node.perimeter);
    ++branch.slender;
  }
  if (!perimeters.empty()) {
    branch.slender_radius_m = upper_median(perimeters) / (2 * std::numbers::pi);
  }
}

GraphBranch branch_of(const ReebLevel& level, const Sweep::Branch& swept) {
  GraphBranch branch;
  std::vector<size_t> divided;  // nodes of each interval
  std::vector<uint32_t> nodes = swept.nodes;
  std::ranges::stable_sort(nodes, std::ranges::greater(),
                           [&](uint32_t n) { return level.nodes[n].interval; });
  for (const uint32_t n : nodes) {
    const ReebNode& node = level.nodes[n];
    branch.area += node.area;
    if (branch.nodes.empty() || level.nodes[branch.nodes.back()].interval != node.interval) {
      branch.nodes.push_back(n);
      divided.push_back(1);
      continue;
    }
    ++divided.back();
    if (node.area > level.nodes[branch.nodes.back()].area) branch.nodes.back() = n;
  }
  branch.end = level.nodes[branch.nodes[0]].centre;
  branch.length_m = level.nodes[branch.nodes[0]].high_m - swept.low_m;
  measure_slender(level, divided, branch);
  return branch;
}

}  // namespace

std::vector<GraphBranch> graph_branches(const ReebGraph& graph, double min_length_m) {
  std::vector<GraphBranch> result;
  if (graph.empty()) return result;
  Sweep sweep(graph.levels.back());
  sweep.run();
  for (const Sweep::Branch& swept : sweep.branches()) {
    const GraphBranch branch = branch_of(graph.levels.back(), swept);
    if (branch.length_m >= min_length_m) result.push_back(branch);
  }
  std::ranges::stable_sort(result, std::ranges::greater(), &GraphBranch::length_m);
  return result;
}

}  // namespace v3d::recon
