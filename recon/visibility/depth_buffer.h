// Depth buffers of a mesh: the distance of the nearest surface at each pixel of a camera.
#pragma once

#include <span>
#include <vector>

#include "base/geometry/camera_model.h"
#include "base/geometry/mesh.h"
#include "recon/render/draw_triangles.h"

namespace v3d {

/// Camera z in metres at the centre of every pixel, row by row; infinity where there is no surface.
struct DepthBuffer {
  ImageSize size;
  std::vector<float> z;
  float at(int x, int y) const { return z[static_cast<size_t>(y) * size.width + x]; }
};

/// Draws the nearest surface. Vertices are projected through the whole lens model; between them,
/// triangles are straight with 1/z linear across the image. Triangles are clipped at the near plane
/// (kNearPlaneMetres); clipped parts are drawn from both sides.
///
/// For a buffer of reduced size pass camera.reduced(). One thread; every instruction set gives the
/// same bits.
DepthBuffer draw_depth(const Mesh& mesh, const CameraModel& camera, Faces faces = Faces::kBoth);

/// One buffer per camera, cameras in parallel; independent of thread count. `buffers` keeps its
/// memory.
void draw_depths(const Mesh& mesh, std::span<const CameraModel> cameras,
                 std::vector<DepthBuffer>& buffers, Faces faces = Faces::kBoth);

}  // namespace v3d
