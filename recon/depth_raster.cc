#include "recon/depth_raster.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <limits>

namespace v3d {
namespace {

/// Keeps the larger 1/z along a run of pixels. `limit`: the largest of the corners, because the
/// plane through a sliver is ill-conditioned. Without branches or calls, so that it is vectorised.
void keep_nearest(float* pixels, int count, float first, float step, float limit) {
  for (int i = 0; i < count; ++i) {
    const float on_plane = first + step * static_cast<float>(i);
    const float inverse = on_plane < limit ? on_plane : limit;
    pixels[i] = inverse > pixels[i] ? inverse : pixels[i];
  }
}

void draw_triangle(const std::array<ScreenVertex, 3>& corner, ImageSize size,
                   std::vector<float>& inverse_z) {
  const Band whole{size.width, 0, size.height};
  if (surely_misses(corner, whole)) {
    return;
  }
  const std::array<double, 3> value{1.0 / corner[0].z, 1.0 / corner[1].z, 1.0 / corner[2].z};
  const ScreenPlane plane(corner, value);
  const auto limit = static_cast<float>(std::max({value[0], value[1], value[2]}));
  for_each_span(corner, whole, [&](int y, int x_begin, int x_end) {
    keep_nearest(inverse_z.data() + static_cast<size_t>(y) * size.width + x_begin, x_end - x_begin,
                 static_cast<float>(plane(x_begin, y)), static_cast<float>(plane.dx), limit);
  });
}

}  // namespace

DepthBuffer draw_depth(const Mesh& mesh, const CameraModel& camera,
                       const std::vector<ScreenVertex>& vertices, int factor, ImageSize size) {
  DepthBuffer buffer{size, std::vector<float>(static_cast<size_t>(size.pixels()), 0.0F)};
  for_each_screen_triangle(mesh, camera, vertices, factor, [&](uint32_t, const ScreenTriangle& t) {
    draw_triangle(t.corner, size, buffer.z);
  });
  for (float& value : buffer.z) {
    value = value > 0 ? 1.0F / value : std::numeric_limits<float>::infinity();
  }
  return buffer;
}

DepthBuffer draw_depth(const Mesh& mesh, const CameraModel& camera) {
  return draw_depth(mesh, camera, project_vertices(mesh, camera), 1, camera.size());
}

std::vector<DepthBuffer> draw_depths(const Mesh& mesh, std::span<const CameraModel> cameras) {
  std::vector<DepthBuffer> buffers(cameras.size());
  tbb::parallel_for(size_t{0}, cameras.size(),
                    [&](size_t i) { buffers[i] = draw_depth(mesh, cameras[i]); });
  return buffers;
}

}  // namespace v3d
