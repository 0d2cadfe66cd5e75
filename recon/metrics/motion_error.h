// Errors of a tracked surface: how far points that it carries are from where they truly are.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "base/geometry/mesh.h"

namespace v3d::recon {

/// Distances of carried points from their true positions.
struct EndPointError {
  int64_t points = 0;
  double p50_mm = 0, p90_mm = 0;
  /// The same along the true surface alone.
  double tangential_p50_mm = 0;
};

/// Carries points with the surfaces of successive pulses. World, metres. One caller at a time.
class CarriedPoints {
 public:
  /// A point farther than this from the first surface is not bound.
  static constexpr double kMaxDistanceM = 0.02;

  /// Binds each of `points` to the nearest point of `surface`: a triangle, barycentric weights, and
  /// an offset in the frame of the triangle.
  CarriedPoints(const Mesh& surface, std::vector<Eigen::Vector3f> points);

  const std::vector<Eigen::Vector3f>& positions() const { return positions_; }
  bool is_bound(size_t point) const { return bindings_[point].triangle != kUnbound; }
  int64_t bound() const;

  /// Moves the points to the next pulse of the same surface: the same triangles, other vertices.
  void follow(const Mesh& surface);
  /// Binds the points that were bound to the nearest points of another surface of the same pulse,
  /// at any distance, so that a lost point counts with its error.
  void change_surface(const Mesh& surface);
  /// As change_surface(), one pulse later: first moves the points on as between the last two
  /// pulses.
  void change_surface_later(const Mesh& surface);
  /// Moves the points to the nearest points of another surface, at any distance: nearest-point
  /// propagation.
  void move_to_nearest(const Mesh& surface);

 private:
  static constexpr uint32_t kUnbound = 0xFFFFFFFF;
  struct Binding {
    uint32_t triangle = kUnbound;
    std::array<double, 3> weights{};
    /// In the frame of the triangle: along its first edge, across it, along its normal.
    Eigen::Vector3d offset_m = Eigen::Vector3d::Zero();
  };
  void bind(const Mesh& surface, double max_distance_m);

  std::vector<Eigen::Vector3f> positions_, before_;
  std::vector<Binding> bindings_;
};

/// Error of the bound points where `chosen` is not 0. `normals`: unit normals of the true surface
/// at the points.
EndPointError end_point_error(const CarriedPoints& carried, std::span<const Eigen::Vector3f> truth,
                              std::span<const Eigen::Vector3f> normals,
                              std::span<const uint8_t> chosen);

/// Unit normals of `surface` at its point nearest to each of `points`; zero without triangles.
std::vector<Eigen::Vector3f> normals_at(const Mesh& surface,
                                        std::span<const Eigen::Vector3f> points);

}  // namespace v3d::recon
