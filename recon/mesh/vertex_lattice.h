// The lattice to which vertices of a compact frame are quantised.
#pragma once

#include <Eigen/Core>
#include <cmath>

namespace v3d {

/// Positions float(origin + h * step) per axis, with an integer h.
struct VertexLattice {
  Eigen::Vector3d origin = Eigen::Vector3d::Zero();  ///< world, metres
  double step = 0;                                   ///< metres
  friend bool operator==(const VertexLattice&, const VertexLattice&) = default;
};

/// The nearest lattice point. Receivers of a compact frame decode the same bits.
inline Eigen::Vector3f rounded_to(const VertexLattice& lattice, const Eigen::Vector3f& position) {
  Eigen::Vector3f rounded;
  for (int axis = 0; axis < 3; ++axis) {
    const double h =
        std::floor((double{position[axis]} - lattice.origin[axis]) / lattice.step + 0.5);
    rounded[axis] = static_cast<float>(lattice.origin[axis] + h * lattice.step);
  }
  return rounded;
}

}  // namespace v3d
