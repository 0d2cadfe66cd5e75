#include <cmath>
#include <numbers>

#include "base/core/error.h"
#include "sim/performer/performer.h"

namespace v3d::sim {
namespace {

using Eigen::Vector3d;

constexpr double kPi = std::numbers::pi;

void add_vertex(Part& part, const Vector3d& position, const Vector3d& paint_place) {
  part.mesh.vertices.push_back(position.cast<float>());
  part.paint.push_back(paint_place.cast<float>());
}

/// Rings of `sides` vertices follow the start point (vertex 0); the end point is the last vertex.
void add_triangles(Mesh& mesh, uint32_t rings, uint32_t sides) {
  const auto at = [&](uint32_t ring, uint32_t side) { return 1 + ring * sides + side % sides; };
  const uint32_t end = 1 + rings * sides;
  for (uint32_t j = 0; j < sides; ++j) {
    mesh.triangles.push_back({0, at(0, j + 1), at(0, j)});
    for (uint32_t i = 0; i + 1 < rings; ++i) {
      mesh.triangles.push_back({at(i, j), at(i, j + 1), at(i + 1, j + 1)});
      mesh.triangles.push_back({at(i, j), at(i + 1, j + 1), at(i + 1, j)});
    }
    mesh.triangles.push_back({end, at(rings - 1, j), at(rings - 1, j + 1)});
  }
}

}  // namespace

Part make_tube(Material material, const std::vector<Ring>& rings, int sides, const RingShape& shape,
               const Vector3d& start_cap, const Vector3d& end_cap) {
  V3D_CHECK(rings.size() >= 2 && sides >= 3);
  Part part;
  part.material = material;
  const Vector3d axis = rings.front().u.cross(rings.front().v).normalized();
  add_vertex(part, rings.front().center + start_cap,
             {0, 0, rings.front().height + start_cap.dot(axis)});
  for (size_t k = 0; k < rings.size(); ++k) {
    const Ring& ring = rings[k];
    for (int j = 0; j < sides; ++j) {
      const double angle = 2 * kPi * j / sides;
      const double r = shape(static_cast<int>(k), angle);
      const double x = r * std::cos(angle);
      const double y = r * std::sin(angle);
      add_vertex(part, ring.center + x * ring.u + y * ring.v,
                 {x * ring.u.norm(), y * ring.v.norm(), ring.height});
    }
  }
  add_vertex(part, rings.back().center + end_cap, {0, 0, rings.back().height + end_cap.dot(axis)});
  add_triangles(part.mesh, static_cast<uint32_t>(rings.size()), static_cast<uint32_t>(sides));
  return part;
}

Part make_capsule(Material material, const Vector3d& from, const Vector3d& to, double from_radius,
                  double to_radius, const Vector3d& reference, double flat, int sides, int rings) {
  const double length = (to - from).norm();
  const Vector3d axis = (to - from) / length;
  const Vector3d u = (reference - reference.dot(axis) * axis).normalized();
  const Vector3d v = axis.cross(u);
  std::vector<Ring> all;
  const auto add = [&](double height, double radius) {
    all.push_back({from + height * axis, radius * u, radius * flat * v, height});
  };
  constexpr int kCap = 5;
  for (int i = 1; i < kCap; ++i) {
    const double a = 0.5 * kPi * i / kCap;
    add(-from_radius * std::cos(a), from_radius * std::sin(a));
  }
  for (int i = 0; i <= rings; ++i) {
    const double s = static_cast<double>(i) / rings;
    add(s * length, from_radius + s * (to_radius - from_radius));
  }
  for (int i = kCap - 1; i >= 1; --i) {
    const double a = 0.5 * kPi * i / kCap;
    add(length + to_radius * std::cos(a), to_radius * std::sin(a));
  }
  const double first = from_radius * (1 - std::cos(0.5 * kPi / kCap));
  const double last = to_radius * (1 - std::cos(0.5 * kPi / kCap));
  return make_tube(
      material, all, sides, [](int, double) { return 1.0; }, -first * axis, last * axis);
}

Part make_ellipsoid(Material material, const Vector3d& center, const Eigen::Matrix3d& axes,
                    const Vector3d& radii, int sides, int rings) {
  std::vector<Ring> all;
  for (int i = 1; i < rings; ++i) {
    const double a = kPi * i / rings;
    const double height = -radii.z() * std::cos(a);
    all.push_back({center + height * axes.col(2), radii.x() * std::sin(a) * axes.col(0),
                   radii.y() * std::sin(a) * axes.col(1), height});
  }
  const Vector3d cap = radii.z() * (1 - std::cos(kPi / rings)) * axes.col(2);
  return make_tube(
      material, all, sides, [](int, double) { return 1.0; }, -cap, cap);
}

}  // namespace v3d::sim
