// The nearest point of a surface.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <vector>

#include "base/mesh.h"

namespace v3d {

struct SurfacePoint {
  double distance = 0;
  uint32_t triangle = 0;
  Eigen::Vector3d weights = Eigen::Vector3d::Zero();  ///< barycentric in the triangle
};

/// The point of a triangle nearest to `p`, as weights of its corners (Ericson, Real-Time Collision
/// Detection, 5.1.5: by the region of the triangle's plane that p falls into).
Eigen::Vector3d nearest_weights(const Eigen::Vector3d& p, const Eigen::Vector3d& a,
                                const Eigen::Vector3d& b, const Eigen::Vector3d& c);

/// A uniform grid over the triangles of a mesh, which is borrowed. Immutable after construction;
/// any thread may ask.
class NearestTriangle {
 public:
  explicit NearestTriangle(const Mesh& mesh);
  /// Exact; of several equally near triangles the one with the lowest number. Empty without
  /// triangles.
  std::optional<SurfacePoint> find(const Eigen::Vector3d& p) const;

 private:
  Eigen::Vector3i cell_of(const Eigen::Vector3d& p) const;
  size_t index(int x, int y, int z) const {
    return (static_cast<size_t>(z) * counts_.y() + y) * counts_.x() + x;
  }
  void look_into(int x, int y, int z, const Eigen::Vector3d& p,
                 std::optional<SurfacePoint>& best) const;
  void look_at_shell(const Eigen::Vector3i& centre, int radius, const Eigen::Vector3d& p,
                     std::optional<SurfacePoint>& best) const;

  const Mesh* mesh_;
  Eigen::Vector3d origin_ = Eigen::Vector3d::Zero();
  double cell_m_ = 1;
  Eigen::Vector3i counts_ = Eigen::Vector3i::Zero();
  std::vector<uint32_t> begin_;      ///< of each cell in triangles_, and the end
  std::vector<uint32_t> triangles_;  ///< cell by cell, ascending in each
};

}  // namespace v3d
