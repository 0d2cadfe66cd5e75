// What the cameras see of a block of vertices: step 1 of the deformation for many at once.
#pragma once

#include <Eigen/Core>
#include <array>
#include <span>
#include <vector>

#include "recon/visibility/depth_buffer.h"
#include "recon/visibility/surface_camera.h"

namespace v3d {

/// Places in the world, metres, one array per coordinate.
struct PointBlock {
  static constexpr size_t kCapacity = 384;
  size_t count = 0;
  alignas(64) std::array<float, kCapacity> x{}, y{}, z{};

  void set(size_t i, const Eigen::Vector3f& place) {
    x[i] = place.x(), y[i] = place.y(), z[i] = place.z();
  }
};

/// Where a camera sees them: SurfaceCamera::project() of each, to the bit. Not numbers where there
/// is no pixel.
struct PixelBlock {
  alignas(64) std::array<float, PointBlock::kCapacity> u, v, z;
};
void project_block(const SurfaceCamera& camera, const PointBlock& points, PixelBlock& pixels);

struct VisibilityOptions {
  float min_facing = 0.3F;  ///< cosine between the normal and the way to a camera
  float tolerance_m = 0;    ///< see SurfaceCamera::sees(); grows with the slant
};

/// One camera and a block of vertices.
struct VertexVisibility {
  static constexpr size_t kCapacity = 128;  ///< vertices; all of it for 15 cameras fits a cache
  alignas(64) std::array<float, kCapacity> u, v, z;  ///< as in PixelBlock
  alignas(64) std::array<float, kCapacity> facing;   ///< cosine, also of what is hidden
  alignas(64) std::array<float, kCapacity> seen;     ///< the same where the camera sees it, else -2

  SurfaceCamera::Seen at(size_t i) const { return {{u[i], v[i]}, z[i]}; }
};

/// `depth` is of the mesh. Requires kCapacity vertices or fewer. Vectorised for the processor it
/// runs on; every processor gives the same bits.
void test_visibility(const SurfaceCamera& camera, const DepthBuffer& depth,
                     const PointBlock& places, const PointBlock& normals,
                     const VisibilityOptions& options, VertexVisibility& visibility);

/// Of the first `count` vertices: those that are seen from aside (the cosine of `facing` is no more
/// than `most_facing`, before or behind) at a pixel that `pixels` has. A bit each; the others are
/// 0.
using VertexBits = std::array<uint64_t, VertexVisibility::kCapacity / 64>;
VertexBits grazing_vertices(const Mask& pixels, const VertexVisibility& visibility, size_t count,
                            float max_facing);

}  // namespace v3d
