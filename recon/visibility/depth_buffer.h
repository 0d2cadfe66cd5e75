// Depth buffers and their inner loop.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "base/geometry/camera_model.h"
#include "base/geometry/mesh.h"
#include "base/image/image.h"
#include "recon/render/rasteriser.h"

namespace v3d::recon {

// Rasterises triangles into a buffer of 1/z: the inner loop of the depth buffer.

/// Which sides of triangles are drawn. The corners of a front are counter-clockwise. On a closed
/// surface seen from outside, fronts hide the backs. There kFront gives the same result faster, up
/// to rounding at outlines. Triangles that are large in the image may be drawn from both sides.
enum class Faces { kBoth, kFront };

/// Writes, at every pixel centre that a triangle covers (for_each_span()), the larger of the buffer
/// and the triangle's 1/z. 1/z is linear in the image and stays between the values of the corners.
/// `inverse_z` has size.pixels() numbers, row by row.
///
/// Triangles with a corner that is not on_screen() are not drawn: their indices are appended to
/// `cut`, whatever their side. The order of the triangles has no influence. Vectorised by run-time
/// dispatch; every instruction set gives the same bits.
void draw_triangles(const std::vector<ScreenVertex>& vertices,
                    std::span<const std::array<uint32_t, 3>> triangles, ImageSize size, Faces faces,
                    float* inverse_z, std::vector<uint32_t>& cut);

/// Bounding rectangle of the on_screen() corners inside the image; empty without corners.
Rect covered_by(const std::vector<ScreenVertex>& vertices, ImageSize size);

/// value > 0 ? 1 / value : infinity, for each value.
void invert(float* values, int count);

// Depth buffers of a mesh: the distance of the nearest surface at each pixel of a camera.

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

}  // namespace v3d::recon
