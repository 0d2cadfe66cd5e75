#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <limits>
#include <numbers>
#include <optional>
#include <span>
#include <tuple>
#include <unordered_map>
#include <unordered_set>
#include <utility>

#include "base/core/union_find.h"
#include "recon/mesh/mesh_neighbours.h"
#include "recon/render/rasteriser.h"
#include "recon/texture/texture_atlas.h"

namespace v3d::recon {
namespace {

constexpr int kNormalPasses = 10;
constexpr int kLabelPasses = 12;
/// Cost of a border between two charts at one edge, against 1 - cosine of a triangle.
constexpr float kBorderCost = 0.4F;
/// Smallest cosine between the normal of a triangle and the direction of its chart.
constexpr float kMinCosine = 0.15F;
/// Parts with fewer triangles join a neighbour where they can.
constexpr size_t kSmallPart = 200;
/// Most triangles of a fold that stays in its chart.
constexpr size_t kMaxFold = 24;
constexpr uint32_t kNone = std::numeric_limits<uint32_t>::max();

/// The triangles at the three edges of every triangle, kNone at a border. At an edge of more than
/// two triangles, the first with opposite direction.
std::vector<std::array<uint32_t, 3>> adjacent_triangles(const Mesh& mesh) {
  const auto key = [](uint32_t a, uint32_t b) { return uint64_t{a} << 32 | b; };
  std::unordered_map<uint64_t, uint32_t> triangle_at;
  triangle_at.reserve(3 * mesh.triangles.size());
  for (uint32_t t = 0; t < mesh.triangles.size(); ++t) {
    for (int k = 0; k < 3; ++k) {
      triangle_at.emplace(key(mesh.triangles[t][k], mesh.triangles[t][(k + 1) % 3]), t);
    }
  }
  std::vector<std::array<uint32_t, 3>> adjacent(mesh.triangles.size(), {kNone, kNone, kNone});
  for (uint32_t t = 0; t < mesh.triangles.size(); ++t) {
    for (int k = 0; k < 3; ++k) {
      const auto other =
          triangle_at.find(key(mesh.triangles[t][(k + 1) % 3], mesh.triangles[t][k]));
      if (other != triangle_at.end()) adjacent[t][k] = other->second;
    }
  }
  return adjacent;
}

std::vector<Eigen::Vector3f> triangle_normals(const Mesh& mesh) {
  std::vector<Eigen::Vector3f> normals;
  normals.reserve(mesh.triangles.size());
  for (const auto& [a, b, c] : mesh.triangles) {
    const Eigen::Vector3f& p = mesh.vertices[a];
    const Eigen::Vector3f normal =
        (mesh.vertices[b] - p).cross(mesh.vertices[c] - p).stableNormalized();
    normals.push_back(normal);
  }
  return normals;
}

/// Normals of the triangles after smoothing over the surface.
std::vector<Eigen::Vector3f> smoothed_normals(const Mesh& mesh) {
  std::vector<Eigen::Vector3f> normals = vertex_normals(mesh), work;
  smooth_normals(Neighbours(mesh), kNormalPasses, normals, work);
  std::vector<Eigen::Vector3f> smoothed;
  smoothed.reserve(mesh.triangles.size());
  for (const auto& [a, b, c] : mesh.triangles) {
    smoothed.push_back((normals[a] + normals[b] + normals[c]).stableNormalized());
  }
  return smoothed;
}

/// Triangles that face a direction.
struct Part {
  std::vector<uint32_t> triangles;  ///< ascending
  Eigen::Vector3f direction;
};

/// The axes and the space diagonals.
std::vector<Eigen::Vector3f> directions() {
  std::vector<Eigen::Vector3f> all;
  for (int axis = 0; axis < 3; ++axis) {
    for (const float sign : {1.0F, -1.0F}) all.push_back(sign * Eigen::Vector3f::Unit(axis));
  }
  for (int i = 0; i < 8; ++i) {
    const Eigen::Vector3f corner(i & 1 ? 1 : -1, i & 2 ? 1 : -1, i & 4 ? 1 : -1);
    all.push_back(corner.normalized());
  }
  return all;
}

/// Chooses a direction for every triangle: iterated conditional modes of a Potts model.
class Labelling {
 public:
  explicit Labelling(const Mesh& mesh)
      : adjacent_(adjacent_triangles(mesh)),
        normals_(triangle_normals(mesh)),
        smoothed_(smoothed_normals(mesh)),
        labels_(mesh.triangles.size(), 0) {
    for (uint32_t t = 0; t < labels_.size(); ++t) labels_[t] = best_label(t, false);
    for (int pass = 0; pass < kLabelPasses && relabel(); ++pass) {
    }
    join_small_parts();
  }

  /// Connected triangles with equal labels.
  std::vector<Part> parts() const {
    std::vector<Part> parts;
    for (std::vector<uint32_t>& triangles : components()) {
      const Eigen::Vector3f direction = directions_[labels_[triangles.front()]];
      parts.push_back({std::move(triangles), direction});
    }
    return parts;
  }

  const std::vector<std::array<uint32_t, 3>>& adjacent() const { return adjacent_; }
  const std::vector<Eigen::Vector3f>& normals() const { return normals_; }

 private:
  uint8_t best_label(uint32_t t, bool with_neighbours) const {
    uint8_t best = 0;
    float min_cost = std::numeric_limits<float>::infinity();
    for (size_t label = 0; label < directions_.size(); ++label) {
      float cost = 1 - smoothed_[t].dot(directions_[label]);
      if (!shows(t, label)) cost += 1;
      for (int k = 0; k < 3 && with_neighbours; ++k) {
        const uint32_t other = adjacent_[t][k];
        if (other != kNone && labels_[other] != label) cost += kBorderCost;
      }
      if (cost < min_cost) {
        min_cost = cost;
        best = static_cast<uint8_t>(label);
      }
    }
    return best;
  }

  bool shows(uint32_t t, size_t label) const {
    return normals_[t].dot(directions_[label]) >= kMinCosine;
  }

  bool relabel() {
    bool changed = false;
    for (uint32_t t = 0; t < labels_.size(); ++t) {
      const uint8_t label = best_label(t, true);
      changed = changed || label != labels_[t];
      labels_[t] = label;
    }
    return changed;
  }

  std::vector<std::vector<uint32_t>> components() const {
    UnionFind sets;
    sets.reset(labels_.size());
    for (uint32_t t = 0; t < labels_.size(); ++t) {
      for (const uint32_t other : adjacent_[t]) {
        if (other != kNone && labels_[other] == labels_[t]) sets.unite(t, other);
      }
    }
    std::vector<std::vector<uint32_t>> components;
    std::vector<uint32_t> component_of(labels_.size(), kNone);
    for (uint32_t t = 0; t < labels_.size(); ++t) {
      const uint32_t root = sets.find(t);  // the smallest triangle, so it came first
      if (root == t) {
        component_of[t] = static_cast<uint32_t>(components.size());
        components.emplace_back();
      }
      components[component_of[root]].push_back(t);
    }
    return components;
  }

  /// The label with the longest border to the part, of those that show all its triangles.
  std::optional<uint8_t> neighbour_label(const std::vector<uint32_t>& part) const {
    std::array<int, 16> border{};
    for (const uint32_t t : part) {
      for (const uint32_t other : adjacent_[t]) {
        if (other != kNone && labels_[other] != labels_[t]) ++border[labels_[other]];
      }
    }
    for (size_t label = 0; label < directions_.size(); ++label) {
      const auto is_shown = [&](uint32_t t) { return shows(t, label); };
      if (!std::all_of(part.begin(), part.end(), is_shown)) border[label] = 0;
    }
    const auto longest = std::max_element(border.begin(), border.end());
    if (*longest == 0) return {};
    return static_cast<uint8_t>(longest - border.begin());
  }

  void join_small_parts() {
    for (const std::vector<uint32_t>& part : components()) {
      if (part.size() >= kSmallPart) continue;
      const auto label = neighbour_label(part);
      for (const uint32_t t : part) labels_[t] = label.value_or(labels_[t]);
    }
  }

  const std::vector<Eigen::Vector3f> directions_ = directions();
  const std::vector<std::array<uint32_t, 3>> adjacent_;
  const std::vector<Eigen::Vector3f> normals_, smoothed_;
  std::vector<uint8_t> labels_;
};

/// Any two axes, right and up, for which right x up is `direction`.
std::pair<Eigen::Vector3f, Eigen::Vector3f> axes_of(const Eigen::Vector3f& direction) {
  const Eigen::Vector3f other =
      std::abs(direction.z()) < 0.9F ? Eigen::Vector3f::UnitZ() : Eigen::Vector3f::UnitY();
  const Eigen::Vector3f right = other.cross(direction).normalized();
  return {right, direction.cross(right)};
}

/// Turns the axes of a chart to the smallest of 16 bounding rectangles, and its longer side up.
void turn_to_small_rectangle(const Mesh& mesh, Chart& chart) {
  const Eigen::Vector3f right = chart.right, up = chart.up;
  float min_area = std::numeric_limits<float>::infinity();
  constexpr int kAngles = 16;
  for (int i = 0; i < kAngles; ++i) {
    const float angle = static_cast<float>(i) * std::numbers::pi_v<float> / 2 / kAngles;
    const Eigen::Vector3f x = std::cos(angle) * right + std::sin(angle) * up;
    const Eigen::Vector3f y = std::cos(angle) * up - std::sin(angle) * right;
    Eigen::Vector2f low = Eigen::Vector2f::Constant(std::numeric_limits<float>::infinity());
    Eigen::Vector2f high = -low;
    for (const uint32_t t : chart.triangles) {
      for (const uint32_t v : mesh.triangles[t]) {
        const Eigen::Vector2f p(mesh.vertices[v].dot(x), mesh.vertices[v].dot(y));
        low = low.cwiseMin(p);
        high = high.cwiseMax(p);
      }
    }
    const Eigen::Vector2f size = high - low;
    if (size.prod() >= min_area) continue;
    min_area = size.prod();
    chart.right = size.y() >= size.x() ? x : y;
    chart.up = size.y() >= size.x() ? y : Eigen::Vector3f(-x);
  }
}

/// Separates the triangles of a part that its projection shows one to one from the others.
class OverlapTest {
 public:
  static constexpr int kOrigin = 1 << 20;  ///< coordinates of for_each_span() start at 0

  OverlapTest(const Mesh& mesh, const std::vector<Eigen::Vector3f>& normals, float cell_m)
      : mesh_(mesh), normals_(normals), cell_m_(cell_m) {}

  /// Moves the triangles of `part` that are turned over or would cover cells of earlier ones to
  /// the result.
  std::vector<uint32_t> remove_overlaps(std::vector<uint32_t>& part,
                                        const Eigen::Vector3f& direction) {
    const auto [right, up] = axes_of(direction);
    covered_.clear();
    std::vector<uint32_t> removed;
    std::erase_if(part, [&, right = right, up = up](uint32_t t) {
      // A triangle without area has no normal, and fits everywhere.
      const bool faces = normals_[t].isZero() || normals_[t].dot(direction) >= kMinCosine;
      const bool fits = faces && cover(t, right, up);
      if (!fits) removed.push_back(t);
      return !fits;
    });
    return removed;
  }

 private:
  /// Covers the cells of the triangle; false, and none covered, when one is covered already.
  bool cover(uint32_t t, const Eigen::Vector3f& right, const Eigen::Vector3f& up) {
    std::array<ScreenVertex, 3> corner;
    for (int k = 0; k < 3; ++k) {
      const Eigen::Vector3f& p = mesh_.vertices[mesh_.triangles[t][k]];
      corner[k].x = p.dot(right) / cell_m_ + kOrigin;
      corner[k].y = p.dot(up) / cell_m_ + kOrigin;
    }
    cells_.clear();
    bool is_free = true;
    for_each_span(corner, Band{2 * kOrigin, 0, 2 * kOrigin}, [&](int y, int begin, int end) {
      for (int x = begin; x < end; ++x) {
        cells_.push_back(static_cast<uint64_t>(y) << 32 | static_cast<uint32_t>(x));
        is_free = is_free && !covered_.contains(cells_.back());
      }
    });
    if (is_free) covered_.insert(cells_.begin(), cells_.end());
    return is_free;
  }

  const Mesh& mesh_;
  const std::vector<Eigen::Vector3f>& normals_;
  const float cell_m_;
  std::unordered_set<uint64_t> covered_;
  std::vector<uint64_t> cells_;
};

/// Connected components of `triangles`.
std::vector<std::vector<uint32_t>> components_of(
    const std::vector<uint32_t>& triangles, const std::vector<std::array<uint32_t, 3>>& adjacent) {
  std::unordered_map<uint32_t, uint32_t> index;
  for (uint32_t i = 0; i < triangles.size(); ++i) index.emplace(triangles[i], i);
  UnionFind sets;
  sets.reset(triangles.size());
  for (uint32_t i = 0; i < triangles.size(); ++i) {
    for (const uint32_t other : adjacent[triangles[i]]) {
      if (const auto at = index.find(other); at != index.end()) sets.unite(i, at->second);
    }
  }
  std::unordered_map<uint32_t, size_t> number;
  std::vector<std::vector<uint32_t>> components;
  for (uint32_t i = 0; i < triangles.size(); ++i) {
    const auto [at, is_new] = number.emplace(sets.find(i), components.size());
    if (is_new) components.emplace_back();
    components[at->second].push_back(triangles[i]);
  }
  return components;
}

/// The first of the charts, ascending triangles each, with a triangle beside one of `fold`.
Chart* chart_beside(const std::vector<uint32_t>& fold,
                    const std::vector<std::array<uint32_t, 3>>& adjacent, std::span<Chart> charts) {
  for (const uint32_t t : fold) {
    for (const uint32_t other : adjacent[t]) {
      const auto beside = std::ranges::find_if(charts, [&](const Chart& chart) {
        return std::ranges::binary_search(chart.triangles, other);
      });
      if (beside != charts.end()) return &*beside;
    }
  }
  return nullptr;
}

/// Moves components of a few triangles, all but the largest, to `removed`, ascending.
void move_islands(std::vector<std::vector<uint32_t>>& components, std::vector<uint32_t>& removed) {
  if (components.size() < 2) return;
  std::ranges::stable_sort(components, std::ranges::greater(), &std::vector<uint32_t>::size);
  while (components.size() > 1 && components.back().size() <= kMaxFold) {
    removed.insert(removed.end(), components.back().begin(), components.back().end());
    components.pop_back();
  }
  std::ranges::sort(removed);
}

/// A direction that at least the first of the triangles faces.
Eigen::Vector3f direction_for(const std::vector<uint32_t>& triangles,
                              const std::vector<Eigen::Vector3f>& normals) {
  Eigen::Vector3f sum = Eigen::Vector3f::Zero();
  for (const uint32_t t : triangles) sum += normals[t];
  const Eigen::Vector3f& first = normals[triangles.front()];
  if (first.dot(sum.stableNormalized()) >= kMinCosine) return sum.stableNormalized();
  return first.isZero() ? Eigen::Vector3f::UnitZ() : first;
}

/// At least `cell_m`, such that the cells of the mesh fit into memory and into the coordinates of
/// OverlapTest, also with a triangle that is much larger than the others.
double limited_cell(const Mesh& mesh, double cell_m) {
  constexpr double kMaxCells = 1 << 24;
  double area_m2 = 0, rows_m = 0, farthest_m = 0;
  for (const auto& t : mesh.triangles) {
    const Eigen::Vector3d p = mesh.vertices[t[0]].cast<double>();
    const Eigen::Vector3d b = mesh.vertices[t[1]].cast<double>() - p;
    const Eigen::Vector3d c = mesh.vertices[t[2]].cast<double>() - p;
    area_m2 += b.cross(c).norm() / 2;
    rows_m += std::max(b.norm(), c.norm());
    farthest_m = std::max({farthest_m, p.norm(), (p + b).norm(), (p + c).norm()});
  }
  return std::max({cell_m, std::sqrt(area_m2 / kMaxCells), rows_m / kMaxCells,
                   farthest_m / (OverlapTest::kOrigin - 1)});
}

}  // namespace

std::vector<Chart> surface_charts(const Mesh& mesh, double cell_m) {
  if (mesh.triangles.empty()) return {};
  const Labelling labelling(mesh);
  if (cell_m <= 0) cell_m = mean_edge(mesh) / 3;
  cell_m = limited_cell(mesh, std::max(1e-5, cell_m));
  OverlapTest test(mesh, labelling.normals(), static_cast<float>(cell_m));
  std::vector<Chart> charts;
  std::vector<Part> waiting = labelling.parts();
  for (size_t i = 0; i < waiting.size(); ++i) {
    Part part = std::move(waiting[i]);
    std::vector<uint32_t> removed = test.remove_overlaps(part.triangles, part.direction);
    const size_t first_chart = charts.size();
    // Triangles without a common edge would leave gaps in the rectangle.
    auto connected = components_of(part.triangles, labelling.adjacent());
    move_islands(connected, removed);
    for (std::vector<uint32_t>& triangles : connected) {
      Chart chart{.triangles = std::move(triangles), .folded = {}};
      std::tie(chart.right, chart.up) = axes_of(part.direction);
      turn_to_small_rectangle(mesh, chart);
      charts.push_back(std::move(chart));
    }
    for (std::vector<uint32_t>& rest : components_of(removed, labelling.adjacent())) {
      Chart* around = rest.size() > kMaxFold ? nullptr
                                             : chart_beside(rest, labelling.adjacent(),
                                                            std::span(charts).subspan(first_chart));
      if (around != nullptr) {
        around->folded.insert(around->folded.end(), rest.begin(), rest.end());
      } else {
        const Eigen::Vector3f direction = direction_for(rest, labelling.normals());
        waiting.push_back({std::move(rest), direction});
      }
    }
  }
  return charts;
}

}  // namespace v3d::recon
