#include "recon/mesh/mesh_neighbours.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <optional>
#include <unordered_map>

#include "base/core/error.h"

namespace v3d::recon {

// In a closed mesh, each edge belongs to two triangles with opposite directions. So the corners
// that follow a vertex in its triangles are its neighbours, each once.
Neighbours::Neighbours(const Mesh& mesh) : first_(mesh.vertices.size() + 1, 0) {
  for (const auto& t : mesh.triangles) {
    for (const uint32_t v : t) ++first_[v + 1];
  }
  for (size_t v = 1; v < first_.size(); ++v) first_[v] += first_[v - 1];
  list_.resize(first_.back());
  std::vector<uint32_t> next(first_.begin(), first_.end() - 1);
  for (const auto& [a, b, c] : mesh.triangles) {
    list_[next[a]++] = b;
    list_[next[b]++] = c;
    list_[next[c]++] = a;
  }
}

NeighbourRows::NeighbourRows(const Neighbours& neighbours) {
  const size_t count = neighbours.size(), groups = (count + kWidth - 1) / kWidth;
  first_.assign(groups + 1, 0);
  counts_.resize(groups);
  const auto for_each_group = [&](const auto& work) {
    tbb::parallel_for(size_t{0}, groups, [&](size_t group) {
      const size_t begin = group * kWidth, end = std::min(count, begin + kWidth);
      for (size_t v = begin; v < end; ++v) work(group, v - begin, neighbours.of(v));
    });
  };
  for_each_group([&](size_t group, size_t lane, std::span<const uint32_t> around) {
    counts_[group].of[lane] = static_cast<float>(around.size());
    first_[group + 1] = std::max(first_[group + 1], static_cast<uint32_t>(around.size()));
  });
  for (size_t group = 0; group < groups; ++group) first_[group + 1] += first_[group];
  Row no_neighbours;
  no_neighbours.vertex.fill(static_cast<int32_t>(vertices()));
  rows_.assign(first_.back(), no_neighbours);
  for_each_group([&](size_t group, size_t lane, std::span<const uint32_t> around) {
    for (size_t k = 0; k < around.size(); ++k) {
      rows_[first_[group] + k].vertex[lane] = static_cast<int32_t>(around[k]);
    }
  });
}

namespace {

using Eigen::Vector3f;

// Lambda and mu of Taubin, for a pass band of 0.11.
constexpr float kForth = 0.5F;
constexpr float kBack = -0.53F;

void step(const Neighbours& neighbours, float factor, std::vector<Vector3f>& vertices,
          std::vector<Vector3f>& work) {
  work.resize(vertices.size());
  for_each_vertex(vertices.size(), [&](size_t v) {
    work[v] = vertices[v] + factor * internal_force(neighbours, vertices, v);
  });
  vertices.swap(work);
}

}  // namespace

Vector3f internal_force(const Neighbours& neighbours, const std::vector<Vector3f>& vertices,
                        size_t vertex) {
  const auto around = neighbours.of(vertex);
  if (around.empty()) return Vector3f::Zero();
  Vector3f sum = Vector3f::Zero();
  for (const uint32_t n : around) sum += vertices[n];
  return sum / static_cast<float>(around.size()) - vertices[vertex];
}

void smooth_surface(const Neighbours& neighbours, int passes, std::vector<Vector3f>& vertices,
                    std::vector<Vector3f>& work) {
  for (int i = 0; i < passes; ++i) {
    step(neighbours, kForth, vertices, work);
    step(neighbours, kBack, vertices, work);
  }
}

void smooth_normals(const Neighbours& neighbours, int passes, std::vector<Vector3f>& normals,
                    std::vector<Vector3f>& work) {
  work.resize(normals.size());
  for (int i = 0; i < passes; ++i) {
    for_each_vertex(normals.size(), [&](size_t v) {
      Vector3f sum = normals[v];
      for (const uint32_t n : neighbours.of(v)) sum += normals[n];
      const float length = sum.norm();
      work[v] = length > 0 ? Vector3f(sum / length) : normals[v];
    });
    normals.swap(work);
  }
}

namespace {

using Triangle = std::array<uint32_t, 3>;

/// Halves the long edges of a mesh, each once.
class EdgeHalver {
 public:
  EdgeHalver(double max_m, std::vector<Eigen::Vector3f>& vertices)
      : max_m_(static_cast<float>(max_m)), vertices_(vertices) {}

  bool halved_any() const { return !middles_.empty(); }

  /// Appends the two to four parts of a triangle, or the triangle without long edges.
  void divide(const Triangle& t, std::vector<Triangle>& parts) {
    const std::array middle = {middle_of(t[0], t[1]), middle_of(t[1], t[2]), middle_of(t[2], t[0])};
    const auto halved = std::count_if(middle.begin(), middle.end(), [](auto m) { return !!m; });
    if (halved == 0) {
      parts.push_back(t);
    } else if (halved == 3) {
      parts.insert(parts.end(), {{t[0], *middle[0], *middle[2]},
                                 {t[1], *middle[1], *middle[0]},
                                 {t[2], *middle[2], *middle[1]},
                                 {*middle[0], *middle[1], *middle[2]}});
    } else {
      // Rotate the corners so that the first edge is halved and the third is not.
      size_t k = 0;
      while (!middle[k] || middle[(k + 2) % 3]) ++k;
      const uint32_t a = t[k], b = t[(k + 1) % 3], c = t[(k + 2) % 3], ab = *middle[k];
      if (const auto bc = middle[(k + 1) % 3]) {
        parts.insert(parts.end(), {{a, ab, c}, {ab, *bc, c}, {ab, b, *bc}});
      } else {
        parts.insert(parts.end(), {{a, ab, c}, {ab, b, c}});
      }
    }
  }

 private:
  std::optional<uint32_t> middle_of(uint32_t a, uint32_t b) {
    const float length = (vertices_[a] - vertices_[b]).norm();
    if (!(length > max_m_)) return {};
    const auto [low, high] = std::minmax(a, b);
    const Eigen::Vector3f middle = 0.5F * (vertices_[low] + vertices_[high]);
    const float half =
        std::max((middle - vertices_[low]).norm(), (middle - vertices_[high]).norm());
    if (!(half <= kMaxHalf * length)) return {};
    const auto [found, added] =
        middles_.try_emplace(uint64_t{low} << 32 | high, static_cast<uint32_t>(vertices_.size()));
    if (added) vertices_.push_back(middle);
    return found->second;
  }

  /// Single precision rounds the middle of an edge whose longer half is longer than this part.
  static constexpr float kMaxHalf = 0.75F;
  const float max_m_;
  std::vector<Eigen::Vector3f>& vertices_;
  std::unordered_map<uint64_t, uint32_t> middles_;
};

}  // namespace

double mean_edge(const Mesh& mesh) {
  double sum = 0;
  for (const auto& [a, b, c] : mesh.triangles) {
    sum += (mesh.vertices[a] - mesh.vertices[b]).norm();
  }
  return sum / static_cast<double>(std::max<size_t>(1, mesh.triangles.size()));
}

double added_triangles(const Mesh& mesh, double max_m) {
  double added = 0;
  for (const auto& t : mesh.triangles) {
    std::array<double, 3> parts{};
    for (size_t k = 0; k < 3; ++k) {
      const Eigen::Vector3f edge = mesh.vertices[t[k]] - mesh.vertices[t[(k + 1) % 3]];
      parts[k] = std::max(1.0, edge.cast<double>().norm() / max_m);
    }
    std::ranges::sort(parts);
    added += parts[0] * parts[2] - 1;
  }
  return added;
}

Mesh with_short_edges(const Mesh& mesh, double max_m) {
  V3D_CHECK(max_m > 0);
  Mesh fine{mesh.vertices, mesh.triangles, {}};
  for (bool again = true; again;) {
    EdgeHalver halver(max_m, fine.vertices);
    std::vector<Triangle> parts;
    for (const Triangle& triangle : fine.triangles) halver.divide(triangle, parts);
    fine.triangles.swap(parts);
    again = halver.halved_any();
  }
  return fine;
}

}  // namespace v3d::recon
