#include <algorithm>
#include <limits>
#include <utility>

#include "base/core/statistics.h"
#include "recon/mesh/mesh_neighbours.h"
#include "recon/metrics/evaluation.h"
#include "recon/metrics/nearest_triangle.h"

namespace v3d::recon {
namespace {

using Eigen::Vector3d;
using Eigen::Vector3f;

constexpr double kMillimetres = 1000;

/// Unit normal of a triangle; zero without area.
Vector3d normal_of(const Mesh& mesh, uint32_t triangle) {
  const auto& [a, b, c] = mesh.triangles[triangle];
  const Vector3d corner = mesh.vertices[a].cast<double>();
  return (mesh.vertices[b].cast<double>() - corner)
      .cross(mesh.vertices[c].cast<double>() - corner)
      .normalized();
}

/// Columns: along the first edge, across it, along the normal. Zero without area.
Eigen::Matrix3d frame_of(const Mesh& mesh, uint32_t triangle) {
  const auto& [a, b, c] = mesh.triangles[triangle];
  Eigen::Matrix3d frame;
  frame.col(2) = normal_of(mesh, triangle);
  frame.col(0) = (mesh.vertices[b] - mesh.vertices[a]).cast<double>().normalized();
  frame.col(1) = frame.col(2).cross(frame.col(0));
  return frame;
}

}  // namespace

CarriedPoints::CarriedPoints(const Mesh& surface, std::vector<Vector3f> points)
    : positions_(std::move(points)), before_(positions_), bindings_(positions_.size()) {
  for (Binding& binding : bindings_) binding.triangle = 0;  // bind() takes all
  bind(surface, kMaxDistanceM);
}

int64_t CarriedPoints::bound() const {
  return std::ranges::count_if(bindings_, [](const Binding& b) { return b.triangle != kUnbound; });
}

void CarriedPoints::bind(const Mesh& surface, double max_distance_m) {
  const NearestTriangle tree(surface);
  for_each_vertex(positions_.size(), [&](size_t i) {
    Binding& binding = bindings_[i];
    if (binding.triangle == kUnbound) return;
    const Vector3d position = positions_[i].cast<double>();
    const auto found = tree.find(position);
    if (!found || found->distance > max_distance_m) {
      binding.triangle = kUnbound;
      return;
    }
    const Vector3d on = interpolated(surface, surface.vertices, found->triangle, found->weights);
    binding = {found->triangle,
               {found->weights[0], found->weights[1], found->weights[2]},
               frame_of(surface, found->triangle).transpose() * (position - on)};
  });
}

void CarriedPoints::follow(const Mesh& surface) {
  before_ = positions_;
  for_each_vertex(positions_.size(), [&](size_t i) {
    const Binding& binding = bindings_[i];
    if (binding.triangle == kUnbound) return;
    const Vector3d on = interpolated(surface, surface.vertices, binding.triangle,
                                     {binding.weights[0], binding.weights[1], binding.weights[2]});
    positions_[i] = (on + frame_of(surface, binding.triangle) * binding.offset_m).cast<float>();
  });
}

void CarriedPoints::change_surface_later(const Mesh& surface) {
  for (size_t i = 0; i < positions_.size(); ++i) {
    const Vector3f next = 2 * positions_[i] - before_[i];
    before_[i] = std::exchange(positions_[i], next);
  }
  change_surface(surface);
}

void CarriedPoints::change_surface(const Mesh& surface) {
  bind(surface, std::numeric_limits<double>::infinity());
}

void CarriedPoints::move_to_nearest(const Mesh& surface) {
  before_ = positions_;
  bind(surface, std::numeric_limits<double>::infinity());
  for (Binding& binding : bindings_) binding.offset_m.setZero();
  const std::vector<Vector3f> before = before_;
  follow(surface);
  before_ = before;
}

EndPointError end_point_error(const CarriedPoints& carried, std::span<const Vector3f> truth,
                              std::span<const Vector3f> normals, std::span<const uint8_t> chosen) {
  std::vector<double> all, tangential;
  for (size_t i = 0; i < truth.size(); ++i) {
    if (chosen[i] == 0 || !carried.is_bound(i)) continue;
    const Vector3d error = (carried.positions()[i] - truth[i]).cast<double>();
    const Vector3d normal = normals[i].cast<double>();
    all.push_back(kMillimetres * error.norm());
    tangential.push_back(kMillimetres * (error - normal.dot(error) * normal).norm());
  }
  if (all.empty()) return {};
  return {std::ssize(all), percentile(all, 0.5), percentile(all, 0.9), percentile(tangential, 0.5)};
}

std::vector<Vector3f> normals_at(const Mesh& surface, std::span<const Vector3f> points) {
  const NearestTriangle tree(surface);
  std::vector<Vector3f> normals(points.size(), Vector3f::Zero());
  for_each_vertex(points.size(), [&](size_t i) {
    const auto found = tree.find(points[i].cast<double>());
    if (found) normals[i] = normal_of(surface, found->triangle).cast<float>();
  });
  return normals;
}

}  // namespace v3d::recon
