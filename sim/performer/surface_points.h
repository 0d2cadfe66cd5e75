// Points that stay at the same place of a performer's surface: the truth for tracked surfaces.
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "sim/performer/performer.h"

namespace v3d::sim {

/// Parts that figures of tracking list.
enum class PointGroup : uint8_t { kOther, kSleeve, kSword };

/// Immutable; any thread.
class SurfacePoints {
 public:
  /// `count` points, evenly by area, on the surfaces of `parts`. Some are inside other parts.
  /// Deterministic for each `seed`.
  SurfacePoints(const std::vector<Part>& parts, size_t count, uint64_t seed);

  const std::vector<PointGroup>& groups() const { return groups_; }
  /// The points at another time: `parts` are the same parts then. World, metres.
  std::vector<Eigen::Vector3f> positions(const std::vector<Part>& parts) const;
  /// The outward unit normals of the triangles at the points.
  std::vector<Eigen::Vector3f> normals(const std::vector<Part>& parts) const;

 private:
  struct Point {
    uint32_t part = 0, triangle = 0;
    Eigen::Vector3f weights = Eigen::Vector3f::Zero();  ///< barycentric
  };
  std::vector<Point> points_;
  std::vector<PointGroup> groups_;
};

}  // namespace v3d::sim
