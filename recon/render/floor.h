// Floor of a rendered scene: a metric grid that fades with distance, and a soft shadow.
#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "base/geometry/mesh.h"
#include "base/geometry/rigid_transform.h"
#include "recon/render/renderer.h"

namespace v3d {

/// Intersection of a ray with the floor.
struct FloorHit {
  double distance_m = 0;  ///< along the ray
  float light = 0;        ///< brightness of the lines over the background, 0 to 1
  float shadow = 0;       ///< 0 none, 1 full
};

/// Immutable after construction; any thread.
class Floor {
 public:
  Floor(const Mesh& mesh, const FloorOptions& options);
  /// `eye` in the world, metres; `direction` of unit length. `pixel_rad` is the angle between two
  /// pixels, for anti-aliasing of the lines. Empty when the ray does not meet the floor.
  std::optional<FloorHit> hit(const Eigen::Vector3d& eye, const Eigen::Vector3d& direction,
                              double pixel_rad) const;

 private:
  void draw_shadow(const Mesh& mesh);
  float shadow_at(double x, double y) const;

  FloorOptions options_;
  Eigen::Vector2d middle_ = Eigen::Vector2d::Zero();
  double radius_m_ = 1;  ///< beyond about twice this the floor has faded
  Eigen::Vector2d shadow_origin_ = Eigen::Vector2d::Zero();
  int shadow_width_ = 0;
  int shadow_height_ = 0;
  std::vector<float> shadow_;
};

}  // namespace v3d
