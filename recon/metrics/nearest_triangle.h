// Points of a surface: nearest point, random samples.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstdint>
#include <optional>
#include <vector>

#include "base/geometry/mesh.h"

namespace v3d::recon {

// Nearest point query on a triangle mesh.

struct SurfacePoint {
  double distance = 0;
  uint32_t triangle = 0;
  Eigen::Vector3d weights = Eigen::Vector3d::Zero();  ///< barycentric in the triangle
};

/// Barycentric weights of the point of triangle a, b, c nearest to `p`. Source: Ericson, Real-Time
/// Collision Detection, 5.1.5.
Eigen::Vector3d nearest_weights(const Eigen::Vector3d& p, const Eigen::Vector3d& a,
                                const Eigen::Vector3d& b, const Eigen::Vector3d& c);

/// Bounding volume hierarchy over the triangles of a mesh, which is borrowed. Immutable after
/// construction; any thread.
class NearestTriangle {
 public:
  explicit NearestTriangle(const Mesh& mesh);
  /// The exact nearest point; of equally near triangles the one with the lowest number. Empty
  /// without triangles.
  std::optional<SurfacePoint> find(const Eigen::Vector3d& p) const;

 private:
  /// Triangles order_[begin .. end). The left child follows its parent; a leaf has right == 0.
  struct Node {
    Eigen::AlignedBox3f box;
    uint32_t begin = 0, end = 0;
    uint32_t right = 0;
  };
  uint32_t build(uint32_t begin, uint32_t end, const std::vector<Eigen::Vector3f>& middles);
  void search_leaf(const Node& leaf, const Eigen::Vector3d& p,
                   std::optional<SurfacePoint>& best) const;

  const Mesh* mesh_;
  std::vector<uint32_t> order_;
  std::vector<Node> nodes_;
};

// Random points of a surface.

struct SurfaceSample {
  Eigen::Vector3d position;
  Eigen::Vector3d normal;  ///< interpolated from the vertices
};

/// Points distributed evenly by area; the same for the same seed on every machine. Empty for a mesh
/// without area.
std::vector<SurfaceSample> sample_surface(const Mesh& mesh, int samples, uint64_t seed);

/// Interpolates `values` of the vertices inside a triangle, with barycentric weights.
Eigen::Vector3d interpolated(const Mesh& mesh, const std::vector<Eigen::Vector3f>& values,
                             uint32_t triangle, const Eigen::Vector3d& weights);

}  // namespace v3d::recon
