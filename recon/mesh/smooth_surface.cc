#include "recon/mesh/smooth_surface.h"

#include "recon/mesh/vertex_loop.h"

namespace v3d {
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

}  // namespace v3d
