// Camera visibility of surface samples, and nearest-point queries on the mesh of a pulse.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "base/geometry/mesh.h"
#include "recon/metrics/nearest_triangle.h"
#include "recon/motion/segment_tracker.h"
#include "recon/surface/template_windows.h"

namespace v3d::recon {

/// Positions and unit normals of vertices of a surface, world, metres.
struct SurfaceSamples {
  std::vector<Eigen::Vector3f> positions, normals;
};
/// Every n-th vertex.
SurfaceSamples every_nth(const Mesh& mesh, std::span<const Eigen::Vector3f> normals, size_t n);

/// The number of cameras that see each position: it is not far behind the surface in `depths`, and
/// faces the camera. Works in the caller's TBB arena.
std::vector<uint8_t> visible_camera_counts(std::span<const Eigen::Vector3f> positions,
                                           std::span<const Eigen::Vector3f> normals,
                                           const SurfaceCameras& cameras,
                                           std::span<const DepthBuffer> depths);

/// The mesh of a pulse, ready for queries. Immutable; any thread.
class ObservedSurface {
 public:
  explicit ObservedSurface(std::shared_ptr<const ObservedPulse> pulse);

  const ObservedPulse& pulse() const { return *pulse_; }
  const Mesh& mesh() const { return pulse_->surface; }
  const std::vector<Eigen::Vector3f>& normals() const { return normals_; }

  struct Nearest {
    Eigen::Vector3f position, normal;
  };
  /// The nearest point; empty when it is farther than `radius_m`.
  std::optional<Nearest> nearest(const Eigen::Vector3f& position, double radius_m) const;
  /// Distance to the nearest point, metres; infinite without a surface.
  double distance(const Eigen::Vector3d& position) const;

 private:
  std::shared_ptr<const ObservedPulse> pulse_;
  std::vector<Eigen::Vector3f> normals_;
  NearestTriangle tree_;
};

}  // namespace v3d::recon
