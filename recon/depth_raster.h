// The depth buffer: how far a camera sees along every pixel before the mesh stops it.
#pragma once

#include <span>
#include <vector>

#include "base/camera_model.h"
#include "base/mesh.h"
#include "recon/screen.h"

namespace v3d {

/// Camera z in metres at the centre of every pixel; infinity where there is no surface.
struct DepthBuffer {
  ImageSize size;
  std::vector<float> z;
  float at(int x, int y) const { return z[static_cast<size_t>(y) * size.width + x]; }
};

/// The nearest surface, front or back side. The lens model holds at the vertices; triangles are
/// straight between them, with 1/z linear across the image. What lies before the near plane is cut
/// away. Pure; one thread.
DepthBuffer draw_depth(const Mesh& mesh, const CameraModel& camera);

/// The same from vertices that were projected (and reduced by `factor`) already. `size`: of the
/// reduced image.
DepthBuffer draw_depth(const Mesh& mesh, const CameraModel& camera,
                       const std::vector<ScreenVertex>& vertices, int factor, ImageSize size);

/// One buffer per camera, cameras in parallel; the result does not depend on the number of threads.
std::vector<DepthBuffer> draw_depths(const Mesh& mesh, std::span<const CameraModel> cameras);

}  // namespace v3d
