// Closed surfaces of revolution in the widest sense: rings of any shape along any path, with a
// point at either end. Every part of the performer is one.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <functional>
#include <vector>

#include "sim/performer.h"

namespace v3d::sim {

/// An ellipse-like ring: center + r(angle) (cos(angle) u + sin(angle) v). `u x v` points along the
/// tube, from its start to its end; then triangles face outward.
struct Ring {
  Eigen::Vector3d center, u, v;
  /// Its place along the rest frame's z; across, paint coordinates are lengths along u and v.
  double height = 0;
};

/// Radius of ring `k` at `angle`, as a factor of u and v.
using RingShape = std::function<double(int k, double angle)>;

/// Requires at least two rings and three sides. The end points lie at the centres of the first and
/// last ring moved by `start_cap` and `end_cap`.
Part make_tube(Material material, const std::vector<Ring>& rings, int sides, const RingShape& shape,
               const Eigen::Vector3d& start_cap, const Eigen::Vector3d& end_cap);

/// A capsule with two radii between two points, round or flattened: `flat` scales the radius across
/// `reference` (which must not be parallel to the axis). Paint height runs from 0 at `from`.
Part make_capsule(Material material, const Eigen::Vector3d& from, const Eigen::Vector3d& to,
                  double from_radius, double to_radius, const Eigen::Vector3d& reference,
                  double flat = 1.0, int sides = 20, int rings = 8);

/// Semi-axes along the columns of `axes` (right-handed). Paint coordinates are those of the axes.
Part make_ellipsoid(Material material, const Eigen::Vector3d& center, const Eigen::Matrix3d& axes,
                    const Eigen::Vector3d& radii, int sides = 32, int rings = 20);

}  // namespace v3d::sim
