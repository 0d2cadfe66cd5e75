#include "recon/motion/deformation_graph.h"

#include <tbb/parallel_for.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <queue>
#include <set>
#include <utility>

#include "base/core/error.h"
#include "base/geometry/rigid_transform.h"

namespace v3d::recon {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

/// A vertex and its distance along the edges of a mesh.
using Reached = std::pair<float, uint32_t>;
using Front = std::priority_queue<Reached, std::vector<Reached>, std::greater<>>;

float edge_length(const Mesh& mesh, uint32_t a, uint32_t b) {
  return (mesh.vertices[a] - mesh.vertices[b]).norm();
}

/// Continues Dijkstra's search from `front` until `limit`; visit(vertex, distance) returns false
/// for a vertex that was reached on a shorter way.
template <class Visit>
void search(const Mesh& mesh, const Neighbours& neighbours, Front& front, float limit,
            const Visit& visit) {
  while (!front.empty()) {
    const auto [distance, vertex] = front.top();
    front.pop();
    if (!visit(vertex, distance)) continue;
    for (const uint32_t next : neighbours.of(vertex)) {
      const float further = distance + edge_length(mesh, vertex, next);
      if (further < limit) front.push({further, next});
    }
  }
}

/// Farthest nodes of two components that are linked, node spacings.
constexpr double kMaxGap = 2.5;

// Stiffness of an edge, by its root mean square deviation from a rigid motion.
constexpr double kRigidM = 0.002;  ///< deviation of stiffness 1
constexpr double kMaxStiffness = 10, kMinStiffness = 0.1;

}  // namespace

DeformationGraph::DeformationGraph(const Mesh& rest, double spacing_m) : spacing_m_(spacing_m) {
  V3D_CHECK(spacing_m > 0);
  const Neighbours neighbours(rest);
  spread_nodes(rest, neighbours);
  find_influences(rest, neighbours);
  find_edges();
  link_components(rest, neighbours);
}

// Farthest points in the order of the vertices: a vertex that no node reaches within the spacing
// becomes a node.
void DeformationGraph::spread_nodes(const Mesh& rest, const Neighbours& neighbours) {
  const auto spacing = static_cast<float>(spacing_m_);
  std::vector<float> distance(rest.vertices.size(), std::numeric_limits<float>::infinity());
  for (uint32_t v = 0; v < distance.size(); ++v) {
    if (distance[v] < spacing || neighbours.of(v).empty()) continue;
    rest_.push_back(rest.vertices[v].cast<double>());
    vertex_of_node_.push_back(v);
    Front front;
    front.push({0.0F, v});
    search(rest, neighbours, front, spacing, [&](uint32_t vertex, float way) {
      if (way >= distance[vertex]) return false;
      distance[vertex] = way;
      return true;
    });
  }
}

void DeformationGraph::find_influences(const Mesh& rest, const Neighbours& neighbours) {
  // Nodes within this distance move a vertex; the nearest kInfluences of them.
  const auto reach = static_cast<float>(2.2 * spacing_m_);
  std::vector<std::vector<Reached>> near(rest.vertices.size());
  std::vector<float> distance(rest.vertices.size(), std::numeric_limits<float>::infinity());
  std::vector<uint32_t> touched;
  for (uint32_t node = 0; node < rest_.size(); ++node) {
    touched.clear();
    Front front;
    front.push({0.0F, vertex_of_node_[node]});
    search(rest, neighbours, front, reach, [&](uint32_t vertex, float way) {
      if (way >= distance[vertex]) return false;
      if (distance[vertex] == std::numeric_limits<float>::infinity()) touched.push_back(vertex);
      distance[vertex] = way;
      return true;
    });
    for (const uint32_t vertex : touched) {
      near[vertex].push_back({distance[vertex], node});
      distance[vertex] = std::numeric_limits<float>::infinity();
    }
  }
  influences_.resize(rest.vertices.size());
  for (size_t v = 0; v < near.size(); ++v) {
    std::sort(near[v].begin(), near[v].end());
    Influence& influence = influences_[v];
    if (near[v].empty()) continue;  // a vertex without triangles
    const size_t count = std::min(near[v].size(), size_t{kInfluences});
    float sum = 0;
    for (size_t k = 0; k < kInfluences; ++k) {
      influence.node[k] = near[v][k < count ? k : 0].second;
      const float share = k < count ? near[v][k].first / reach : 1;
      influence.weight[k] = (1 - share) * (1 - share);
      sum += influence.weight[k];
    }
    for (float& weight : influence.weight) weight /= sum;
  }
}

void DeformationGraph::find_edges() {
  std::map<std::pair<uint32_t, uint32_t>, int> shared;
  for (const Influence& influence : influences_) {
    for (int i = 0; i < kInfluences; ++i) {
      for (int k = i + 1; k < kInfluences; ++k) {
        const uint32_t a = influence.node[i], b = influence.node[k];
        if (a != b && influence.weight[i] > 0 && influence.weight[k] > 0) {
          ++shared[std::minmax(a, b)];
        }
      }
    }
  }
  for (const auto& [pair, count] : shared) edges_.push_back({pair.first, pair.second, 1});
}

void DeformationGraph::link_components(const Mesh& rest, const Neighbours& neighbours) {
  std::vector<uint32_t> component(rest.vertices.size(), std::numeric_limits<uint32_t>::max());
  for (const uint32_t first : vertex_of_node_) {
    if (component[first] != std::numeric_limits<uint32_t>::max()) continue;
    std::vector<uint32_t> open{first};
    component[first] = first;
    while (!open.empty()) {
      const uint32_t vertex = open.back();
      open.pop_back();
      for (const uint32_t next : neighbours.of(vertex)) {
        if (component[next] == first) continue;
        component[next] = first;
        open.push_back(next);
      }
    }
  }
  // By node and component, the nearest node of the component.
  std::set<std::pair<uint32_t, uint32_t>> links;
  for (uint32_t a = 0; a < rest_.size(); ++a) {
    std::map<uint32_t, std::pair<double, uint32_t>> nearest;
    for (uint32_t b = 0; b < rest_.size(); ++b) {
      const uint32_t other = component[vertex_of_node_[b]];
      const double distance = (rest_[a] - rest_[b]).norm();
      if (other == component[vertex_of_node_[a]] || distance > kMaxGap * spacing_m_) continue;
      const auto at = nearest.try_emplace(other, distance, b).first;
      at->second = std::min(at->second, {distance, b});
    }
    for (const auto& [other, link] : nearest) links.insert(std::minmax(a, link.second));
  }
  for (const auto& [a, b] : links) edges_.push_back({a, b, 1});
}

std::vector<NodeMotion> DeformationGraph::rest_motion() const {
  std::vector<NodeMotion> motion(rest_.size());
  for (size_t n = 0; n < rest_.size(); ++n) motion[n].position = rest_[n];
  return motion;
}

Vector3d DeformationGraph::moved(std::span<const NodeMotion> motion, size_t v,
                                 const Vector3d& rest) const {
  const Influence& influence = influences_[v];
  Vector3d sum = Vector3d::Zero();
  for (int k = 0; k < kInfluences; ++k) {
    const NodeMotion& node = motion[influence.node[k]];
    sum += double{influence.weight[k]} *
           (node.rotation * (rest - rest_[influence.node[k]]) + node.position);
  }
  return sum;
}

Matrix3d DeformationGraph::rotation_at(std::span<const NodeMotion> motion, size_t v) const {
  const Influence& influence = influences_[v];
  Matrix3d sum = Matrix3d::Zero();
  for (int k = 0; k < kInfluences; ++k) {
    sum += double{influence.weight[k]} * motion[influence.node[k]].rotation;
  }
  return nearest_rotation(sum);
}

void DeformationGraph::move(std::span<const NodeMotion> motion,
                            const std::vector<Eigen::Vector3f>& rest,
                            std::vector<Eigen::Vector3f>& moved_vertices) const {
  moved_vertices.resize(rest.size());
  for_each_vertex(rest.size(), [&](size_t v) {
    moved_vertices[v] = moved(motion, v, rest[v].cast<double>()).cast<float>();
  });
}

void learn_stiffness(DeformationGraph& graph, std::span<const std::vector<NodeMotion>> motions) {
  V3D_CHECK(!motions.empty());
  for (DeformationGraph::Edge& edge : graph.edges()) {
    const Vector3d rest = graph.rest()[edge.b] - graph.rest()[edge.a];
    double sum = 0;
    for (const std::vector<NodeMotion>& motion : motions) {
      const NodeMotion& a = motion[edge.a];
      const NodeMotion& b = motion[edge.b];
      sum += (a.rotation * rest + a.position - b.position).squaredNorm();
      sum += (b.rotation * rest + a.position - b.position).squaredNorm();
    }
    const double square = sum / (2 * static_cast<double>(motions.size()));
    edge.stiffness =
        static_cast<float>(std::clamp(kRigidM * kRigidM / square, kMinStiffness, kMaxStiffness));
  }
}

namespace {

/// `now`, turned `ratio` times as far as from `before` to `now`.
Matrix3d turned_on(const Matrix3d& before, const Matrix3d& now, double ratio) {
  if (ratio == 1) return now * before.transpose() * now;
  const Matrix3d once = now * before.transpose();
  const Eigen::AngleAxisd turn(once);
  return Eigen::AngleAxisd(ratio * turn.angle(), turn.axis()).toRotationMatrix() * now;
}

}  // namespace

std::vector<NodeMotion> with_same_speed(std::span<const NodeMotion> before,
                                        std::span<const NodeMotion> now, double ratio) {
  V3D_CHECK(before.size() == now.size() && ratio > 0);
  std::vector<NodeMotion> next(now.size());
  for (size_t n = 0; n < now.size(); ++n) {
    const Matrix3d turned = turned_on(before[n].rotation, now[n].rotation, ratio);
    // Without this, rounding errors double with each pulse that is only predicted.
    next[n].rotation = Eigen::Quaterniond(turned).normalized().toRotationMatrix();
    next[n].position = (1 + ratio) * now[n].position - ratio * before[n].position;
  }
  return next;
}

}  // namespace v3d::recon
