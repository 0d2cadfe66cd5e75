#include "v3dctl/export/vertex_streams.h"

#include <cmath>

namespace v3d::ctl {
namespace {

constexpr double kMostSteps = 65535;

/// Whole steps of `lattice` from its origin.
Eigen::Vector3d steps_to(const Eigen::Vector3f& vertex, const VertexLattice& lattice) {
  return ((vertex.cast<double>() - lattice.origin) / lattice.step).array().round();
}

}  // namespace

size_t bytes_of(Component component) {
  switch (component) {
    case Component::kUint8:
      return 1;
    case Component::kUint16:
      return 2;
    case Component::kFloat:
      return 4;
  }
  return 0;
}

PositionGrid place_on_grid(const std::vector<Eigen::Vector3f>& vertices,
                           const VertexLattice& lattice) {
  PositionGrid grid;
  if (vertices.empty()) return grid;
  Eigen::Vector3f low = vertices.front(), high = low;
  for (const Eigen::Vector3f& vertex : vertices) {
    low = low.cwiseMin(vertex);
    high = high.cwiseMax(vertex);
  }
  const double extent = (high - low).cast<double>().maxCoeff();
  grid.step = lattice.step;
  if (grid.step > 0) {
    // A vertex of the finer lattice is at most half a step from one of twice its step.
    while (extent / grid.step > kMostSteps - 1) grid.step *= 2;
    const VertexLattice coarser{lattice.origin, grid.step};
    grid.origin = lattice.origin + grid.step * steps_to(low, coarser);
  } else {
    grid.step = extent > 0 ? extent / kMostSteps : 1;
    grid.origin = low.cast<double>();
  }
  for (const Eigen::Vector3f& vertex : vertices) {
    const Eigen::Vector3d steps = steps_to(vertex, {grid.origin, grid.step});
    auto& place = grid.places.emplace_back();
    for (int axis = 0; axis < 3; ++axis) {
      place[axis] = static_cast<uint16_t>(std::clamp(steps[axis], 0.0, kMostSteps));
      grid.last = std::max(grid.last, place[axis]);
    }
  }
  return grid;
}

double linear_light(uint8_t srgb) {
  const double s = srgb / 255.0;
  return s <= 0.04045 ? s / 12.92 : std::pow((s + 0.055) / 1.055, 2.4);
}

}  // namespace v3d::ctl
