#include "recon/skeleton/geodesic_integral.h"

#include <tbb/parallel_for.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <functional>
#include <numeric>
#include <span>
#include <utility>

#include "recon/mesh/mesh_neighbours.h"

namespace v3d::recon {

VertexGraph::VertexGraph(size_t vertices, const std::vector<Edge>& edges)
    : first_(vertices + 1, 0) {
  for (const Edge& edge : edges) {
    ++first_[edge.a + 1];
    ++first_[edge.b + 1];
  }
  for (size_t v = 1; v < first_.size(); ++v) first_[v] += first_[v - 1];
  links_.resize(first_.back());
  std::vector<uint32_t> next(first_.begin(), first_.end() - 1);
  for (const Edge& edge : edges) {
    links_[next[edge.a]++] = {edge.b, edge.metres};
    links_[next[edge.b]++] = {edge.a, edge.metres};
  }
}

VertexGraph::VertexGraph(const Mesh& mesh) {
  std::vector<uint32_t> begin(mesh.vertices.size() + 1, 0);
  for (const auto& triangle : mesh.triangles) {
    for (const uint32_t v : triangle) begin[v + 1] += 2;
  }
  for (size_t v = 1; v < begin.size(); ++v) begin[v] += begin[v - 1];
  std::vector<uint32_t> others(begin.back()), end(begin.begin(), begin.end() - 1);
  for (const auto& triangle : mesh.triangles) {
    for (size_t corner = 0; corner < 3; ++corner) {
      const uint32_t v = triangle[corner];
      for (const size_t step : {size_t{1}, size_t{2}}) {
        const uint32_t other = triangle[(corner + step) % 3];
        auto* const first = others.data() + begin[v];
        auto* const last = others.data() + end[v];
        if (other == v || std::find(first, last, other) != last) continue;
        *last = other;
        ++end[v];
      }
    }
  }
  first_.assign(begin.size(), 0);
  links_.reserve(others.size() / 2);
  for (size_t v = 0; v < mesh.vertices.size(); ++v) {
    for (uint32_t i = begin[v]; i < end[v]; ++i) {
      const float metres = (mesh.vertices[others[i]] - mesh.vertices[v]).norm();
      links_.push_back({others[i], metres});
    }
    first_[v + 1] = static_cast<uint32_t>(links_.size());
  }
}

void ShortestPaths::push(Entry entry) {
  queue_.push_back(entry);
  std::ranges::push_heap(queue_, std::greater<>());
}

ShortestPaths::Entry ShortestPaths::pop() {
  std::ranges::pop_heap(queue_, std::greater<>());
  const Entry entry = queue_.back();
  queue_.pop_back();
  return entry;
}

namespace {

using Eigen::Vector3d;
using Eigen::Vector3f;

constexpr auto kNone = GeodesicIntegral::kNoComponent;

/// Samples that cover the surface, and the regions nearest to each.
struct SampledSurface {
  std::vector<uint32_t> vertices;    ///< of the samples
  std::vector<uint32_t> owner;       ///< nearest sample of each vertex
  std::vector<double> areas;         ///< of the regions
  std::vector<uint32_t> components;  ///< of the samples
  VertexGraph touching;              ///< samples whose regions touch
  VertexGraph paths;                 ///< also two steps
};

/// The vertices with links, those farthest from the centre first.
std::vector<uint32_t> from_outside_in(const Mesh& mesh, const VertexGraph& graph,
                                      const std::vector<double>& areas) {
  Vector3d centre = Vector3d::Zero();
  double sum = 0;
  for (size_t v = 0; v < areas.size(); ++v) {
    centre += areas[v] * mesh.vertices[v].cast<double>();
    sum += areas[v];
  }
  centre /= sum;
  std::vector<std::pair<float, uint32_t>> order;
  order.reserve(areas.size());
  for (uint32_t v = 0; v < areas.size(); ++v) {
    if (graph.of(v).empty()) continue;
    const double distance = (mesh.vertices[v].cast<double>() - centre).squaredNorm();
    order.emplace_back(static_cast<float>(-distance), v);
  }
  std::ranges::sort(order);
  std::vector<uint32_t> vertices(order.size());
  std::ranges::transform(order, vertices.begin(), [](const auto& entry) { return entry.second; });
  return vertices;
}

/// Samples that cover a graph: every vertex is nearer than a spacing to one.
struct Cover {
  std::vector<uint32_t> vertices;  ///< of the samples
  std::vector<uint32_t> owner;     ///< nearest sample of each vertex; kNone for one without links
};

Cover cover(const VertexGraph& graph, std::span<const uint32_t> order, float spacing_m) {
  Cover result;
  std::vector<float> nearest(graph.size(), ShortestPaths::kUnreached);
  result.owner.assign(graph.size(), kNone);
  ShortestPaths paths;
  for (const uint32_t vertex : order) {
    if (nearest[vertex] < spacing_m) continue;
    const auto sample = static_cast<uint32_t>(result.vertices.size());
    result.vertices.push_back(vertex);
    nearest[vertex] = 0;
    result.owner[vertex] = sample;
    paths.run(graph, std::span(&vertex, 1), spacing_m, nearest,
              [&](uint32_t reached, uint32_t) { result.owner[reached] = sample; });
  }
  return result;
}

VertexGraph touching_regions(const Mesh& mesh, const VertexGraph& graph,
                             const SampledSurface& surface) {
  std::vector<VertexGraph::Edge> edges;
  for (uint32_t v = 0; v < graph.size(); ++v) {
    for (const VertexGraph::Link& link : graph.of(v)) {
      const uint32_t a = surface.owner[v], b = surface.owner[link.to];
      if (v < link.to && a != b) edges.push_back({std::min(a, b), std::max(a, b), 0});
    }
  }
  const auto key = [](const VertexGraph::Edge& edge) { return std::pair(edge.a, edge.b); };
  std::ranges::sort(edges, {}, key);
  const auto same = [&](const auto& a, const auto& b) { return key(a) == key(b); };
  edges.erase(std::unique(edges.begin(), edges.end(), same), edges.end());
  for (VertexGraph::Edge& edge : edges) {
    edge.metres =
        (mesh.vertices[surface.vertices[edge.a]] - mesh.vertices[surface.vertices[edge.b]]).norm();
  }
  return {surface.vertices.size(), edges};
}

/// Also joins samples two steps apart: paths over one or two steps bend less.
VertexGraph with_short_cuts(const Mesh& mesh, const SampledSurface& surface) {
  std::vector<VertexGraph::Edge> edges;
  std::vector<uint32_t> seen(surface.vertices.size(), kNone);
  for (uint32_t a = 0; a < surface.vertices.size(); ++a) {
    seen[a] = a;
    const auto add = [&](uint32_t b) {
      if (seen[b] == a) return;
      seen[b] = a;
      const Vector3f& from = mesh.vertices[surface.vertices[a]];
      if (a < b) edges.push_back({a, b, (mesh.vertices[surface.vertices[b]] - from).norm()});
    };
    for (const VertexGraph::Link& link : surface.touching.of(a)) add(link.to);
    for (const VertexGraph::Link& link : surface.touching.of(a)) {
      for (const VertexGraph::Link& second : surface.touching.of(link.to)) add(second.to);
    }
  }
  return {surface.vertices.size(), edges};
}

std::vector<uint32_t> components_of(const VertexGraph& graph) {
  std::vector<uint32_t> component(graph.size(), kNone), stack;
  uint32_t count = 0;
  for (uint32_t start = 0; start < graph.size(); ++start) {
    if (component[start] != kNone) continue;
    component[start] = count;
    stack.push_back(start);
    while (!stack.empty()) {
      const uint32_t at = stack.back();
      stack.pop_back();
      for (const VertexGraph::Link& link : graph.of(at)) {
        if (component[link.to] != kNone) continue;
        component[link.to] = count;
        stack.push_back(link.to);
      }
    }
    ++count;
  }
  return component;
}

/// Spacing of about `count` samples that cover() spreads over an area. Their balls overlap: of
/// samples r apart, about 1.3 lie in an area of r x r.
float spacing_of(double area_m2, size_t count) {
  return static_cast<float>(std::sqrt(1.3 * area_m2 / static_cast<double>(count)));
}

SampledSurface sample_surface(const Mesh& mesh, const VertexGraph& graph,
                              const std::vector<double>& areas, float spacing_m) {
  SampledSurface surface;
  Cover samples = cover(graph, from_outside_in(mesh, graph, areas), spacing_m);
  surface.vertices = std::move(samples.vertices);
  surface.owner = std::move(samples.owner);
  surface.areas.assign(surface.vertices.size(), 0);
  for (size_t v = 0; v < areas.size(); ++v) {
    if (surface.owner[v] != kNone) surface.areas[surface.owner[v]] += areas[v];
  }
  surface.touching = touching_regions(mesh, graph, surface);
  surface.paths = with_short_cuts(mesh, surface);
  surface.components = components_of(surface.touching);
  return surface;
}

/// Mean distances of the samples to the surface of their component.
std::vector<float> integrate(const SampledSurface& surface, double area_m2, size_t count) {
  std::vector<uint32_t> order(surface.vertices.size());
  std::iota(order.begin(), order.end(), 0U);
  const Cover bases = cover(surface.paths, order, spacing_of(area_m2, count));
  std::vector<double> weights(bases.vertices.size(), 0);
  std::vector<double> component_areas(surface.vertices.size(), 0);
  for (size_t s = 0; s < order.size(); ++s) {
    weights[bases.owner[s]] += surface.areas[s];
    component_areas[surface.components[s]] += surface.areas[s];
  }
  std::vector<std::vector<float>> rows(bases.vertices.size());
  tbb::parallel_for(size_t{0}, rows.size(), [&](size_t b) {
    ShortestPaths paths;
    rows[b].assign(order.size(), ShortestPaths::kUnreached);
    rows[b][bases.vertices[b]] = 0;
    paths.run(surface.paths, std::span(&bases.vertices[b], 1), ShortestPaths::kUnreached, rows[b],
              [](uint32_t, uint32_t) {});
  });
  std::vector<float> means(order.size(), 0);
  tbb::parallel_for(size_t{0}, order.size(), [&](size_t s) {
    double integral = 0;
    for (size_t b = 0; b < rows.size(); ++b) {
      if (rows[b][s] < ShortestPaths::kUnreached) integral += weights[b] * double{rows[b][s]};
    }
    const double area = component_areas[surface.components[s]];
    means[s] = area > 0 ? static_cast<float>(integral / area) : 0.0F;
  });
  return means;
}

/// Smooth interpolation: weights fall to 0 at the samples' second neighbours.
void interpolate(const Mesh& mesh, const SampledSurface& surface, const std::vector<float>& means,
                 std::vector<float>& result) {
  for_each_vertex(mesh.vertices.size(), [&](size_t v) {
    const uint32_t owner = surface.owner[v];
    if (owner == kNone) return;
    float sum = 0, weights = 0, reach = 0;
    for (const VertexGraph::Link& link : surface.touching.of(owner)) {
      reach = std::max(reach, link.metres);
    }
    const auto add = [&](uint32_t sample) {
      const Vector3f& position = mesh.vertices[surface.vertices[sample]];
      const float squared = (position - mesh.vertices[v]).squaredNorm();
      const float weight =
          reach > 0 ? std::max(1 - squared / (1.44F * reach * reach), 1e-3F) : 1.0F;
      sum += weight * weight * means[sample];
      weights += weight * weight;
    };
    add(owner);
    for (const VertexGraph::Link& link : surface.touching.of(owner)) add(link.to);
    result[v] = sum / weights;
  });
}

void normalise(GeodesicIntegral& integral) {
  std::vector<float> least(integral.components, ShortestPaths::kUnreached);
  std::vector<float> greatest(integral.components, 0);
  for (size_t v = 0; v < integral.metres.size(); ++v) {
    const uint32_t component = integral.component[v];
    if (component == kNone) continue;
    least[component] = std::min(least[component], integral.metres[v]);
    greatest[component] = std::max(greatest[component], integral.metres[v]);
  }
  for (size_t v = 0; v < integral.metres.size(); ++v) {
    const uint32_t component = integral.component[v];
    if (component == kNone || greatest[component] <= 0) continue;
    integral.normalised[v] = (integral.metres[v] - least[component]) / greatest[component];
  }
}

}  // namespace

std::vector<double> vertex_areas(const Mesh& mesh) {
  std::vector<double> areas(mesh.vertices.size(), 0);
  for (const auto& [a, b, c] : mesh.triangles) {
    const Vector3f across = mesh.vertices[b] - mesh.vertices[a];
    const double area = across.cross(mesh.vertices[c] - mesh.vertices[a]).norm() / 6;
    areas[a] += area;
    areas[b] += area;
    areas[c] += area;
  }
  return areas;
}

GeodesicIntegral geodesic_integral(const Mesh& mesh, const VertexGraph& graph,
                                   const GeodesicOptions& options) {
  GeodesicIntegral integral;
  integral.metres.assign(mesh.vertices.size(), 0);
  integral.normalised.assign(mesh.vertices.size(), 0);
  integral.component.assign(mesh.vertices.size(), kNone);
  const std::vector<double> areas = vertex_areas(mesh);
  const double area = std::accumulate(areas.begin(), areas.end(), 0.0);
  if (area <= 0) return integral;
  const SampledSurface surface =
      sample_surface(mesh, graph, areas, spacing_of(area, std::max(options.samples, size_t{1})));
  const std::vector<float> means = integrate(surface, area, std::max(options.bases, size_t{1}));
  interpolate(mesh, surface, means, integral.metres);
  for (size_t v = 0; v < mesh.vertices.size(); ++v) {
    if (surface.owner[v] == kNone) continue;
    integral.component[v] = surface.components[surface.owner[v]];
    integral.components = std::max(integral.components, size_t{integral.component[v]} + 1);
  }
  normalise(integral);
  return integral;
}

}  // namespace v3d::recon
