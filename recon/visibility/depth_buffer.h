// The depth buffer: how far a camera sees along every pixel before the mesh stops it.
#pragma once

#include <span>
#include <vector>

#include "base/camera_model.h"
#include "base/mesh.h"
#include "recon/render/draw_triangles.h"

namespace v3d {

/// Camera z in metres at the centre of every pixel; infinity where there is no surface.
struct DepthBuffer {
  ImageSize size;
  std::vector<float> z;
  float at(int x, int y) const { return z[static_cast<size_t>(y) * size.width + x]; }
};

/// The nearest surface. The lens model holds at the vertices; triangles are
/// straight between them, with 1/z linear across the image. What lies before the near plane is cut
/// away, and drawn from both sides. Pure; one thread; the same bits on every processor. For a
/// buffer of reduced size, give camera.reduced().
DepthBuffer draw_depth(const Mesh& mesh, const CameraModel& camera, Faces faces = Faces::kBoth);

/// One buffer per camera, cameras in parallel; the result does not depend on the number of threads.
/// `buffers` keeps its memory.
void draw_depths(const Mesh& mesh, std::span<const CameraModel> cameras,
                 std::vector<DepthBuffer>& buffers, Faces faces = Faces::kBoth);

}  // namespace v3d
