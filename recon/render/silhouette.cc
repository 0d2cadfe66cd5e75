#include "recon/render/silhouette.h"

#include <tbb/parallel_for.h>

#include "recon/render/rasteriser.h"

namespace v3d {

Mask draw_silhouette(const Mesh& mesh, const CameraModel& camera) {
  Mask mask(camera.size());
  const Band whole{camera.size().width, 0, camera.size().height};
  const auto fill = [&](int y, int x_begin, int x_end) { mask.fill_row(y, x_begin, x_end); };
  for_each_screen_triangle(
      mesh, camera, project_vertices(mesh, camera),
      [&](uint32_t, const ScreenTriangle& t) { for_each_span(t.corner, whole, fill); });
  return mask;
}

std::vector<Mask> draw_silhouettes(const Mesh& mesh, std::span<const CameraModel> cameras) {
  std::vector<Mask> masks(cameras.size());
  tbb::parallel_for(size_t{0}, cameras.size(),
                    [&](size_t i) { masks[i] = draw_silhouette(mesh, cameras[i]); });
  return masks;
}

}  // namespace v3d
