#include "recon/mesh/mesh_edges.h"

#include <algorithm>
#include <optional>
#include <unordered_map>

#include "base/core/check.h"

namespace v3d {
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
    if (!((vertices_[a] - vertices_[b]).norm() > max_m_)) return {};
    const auto [low, high] = std::minmax(a, b);
    const auto [found, added] =
        middles_.try_emplace(uint64_t{low} << 32 | high, static_cast<uint32_t>(vertices_.size()));
    if (added) vertices_.emplace_back(0.5F * (vertices_[low] + vertices_[high]));
    return found->second;
  }

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

}  // namespace v3d
