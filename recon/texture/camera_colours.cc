#include "recon/texture/camera_colours.h"

#include <tbb/parallel_for.h>

#include <algorithm>

#include "recon/texture/vertex_cameras.h"
#include "recon/visibility/surface_points.h"

namespace v3d {
namespace {

std::array<uint8_t, 4> seen_colour(const std::array<float, 4>& sum, Visibility visibility) {
  std::array<uint8_t, 4> colour{0, 0, 0, static_cast<uint8_t>(visibility)};
  for (size_t k = 0; k < 3; ++k) {
    colour[k] = static_cast<uint8_t>(std::clamp(sum[k] / sum[3], 0.0F, 255.0F) + 0.5F);
  }
  return colour;
}

void accumulate(const VertexCamera& camera, const PointArrays& vertices, const PointArrays& normals,
                std::vector<std::array<uint8_t, 4>>& colours) {
  tbb::parallel_for(size_t{0}, vertices.blocks(), [&](size_t block) {
    const size_t first = block * PointArrays::kBlock;
    ColourSums sums;
    accumulate_vertex_colours(camera, vertices, normals, first, sums);
    for (size_t v = first; v < std::min(colours.size(), first + PointArrays::kBlock); ++v) {
      const auto &inner = sums.inner[v - first], &rim = sums.rim[v - first];
      if (inner[3] > 0) {
        colours[v] = seen_colour(inner, Visibility::kFull);
      } else if (rim[3] > 0) {
        colours[v] = seen_colour(rim, Visibility::kRim);
      }
    }
  });
}

std::vector<CameraColours> blind(std::span<const TextureCamera> cameras, size_t vertices) {
  std::vector<CameraColours> colours;
  for (const TextureCamera& camera : cameras) {
    colours.push_back({camera.frame->camera, std::vector<std::array<uint8_t, 4>>(vertices)});
  }
  std::sort(colours.begin(), colours.end(),
            [](const auto& a, const auto& b) { return a.camera < b.camera; });
  return colours;
}

}  // namespace

std::vector<CameraColours> camera_colours(const Mesh& mesh, std::span<const TextureCamera> cameras,
                                          const TextureOptions& options) {
  std::vector<CameraColours> colours = blind(cameras, mesh.vertices.size());
  if (mesh.vertices.empty()) return colours;
  const PointArrays vertices(mesh.vertices), normals(vertex_normals(mesh));
  const PointArrays occluders(occluding_points(mesh, options.occluder_radius_m));
  for (VertexCamera& camera :
       vertex_cameras(occluders, {cameras.begin(), cameras.end()}, options)) {
    camera.weight = 1;
    const auto of_camera =
        std::lower_bound(colours.begin(), colours.end(), camera.frame->camera,
                         [](const auto& c, const std::string& name) { return c.camera < name; });
    accumulate(camera, vertices, normals, of_camera->vertices);
  }
  return colours;
}

}  // namespace v3d
