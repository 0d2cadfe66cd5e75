#include "recon/visibility/depth_buffer.h"

#include <tbb/enumerable_thread_specific.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <limits>

#include "recon/render/draw_triangles.h"
#include "recon/render/rasteriser.h"

namespace v3d {
namespace {

/// Working memory of one thread.
struct Workspace {
  std::vector<ScreenVertex> vertices;
  std::vector<uint32_t> cut;
};

/// Draws the remaining parts of triangles that extend behind the near plane or beyond the lens
/// model.
void draw_cut(const Mesh& mesh, const CameraModel& camera, const Workspace& work,
              DepthBuffer& buffer) {
  std::vector<ScreenTriangle> pieces;
  std::vector<ScreenVertex> corners;
  std::vector<std::array<uint32_t, 3>> triangles;
  for (const uint32_t t : work.cut) {
    clip_to_near_plane(mesh, t, camera, work.vertices, pieces);
    for (const ScreenTriangle& piece : pieces) {
      const auto first = static_cast<uint32_t>(corners.size());
      corners.insert(corners.end(), piece.corner.begin(), piece.corner.end());
      triangles.push_back({first, first + 1, first + 2});
    }
  }
  std::vector<uint32_t> none;
  draw_triangles(corners, triangles, buffer.size, Faces::kBoth, buffer.z.data(), none);
}

void draw(const Mesh& mesh, const CameraModel& camera, Faces faces, Workspace& work,
          DepthBuffer& buffer) {
  constexpr float kNothing = std::numeric_limits<float>::infinity();
  const ImageSize size = camera.size();
  project_vertices(mesh, camera, work.vertices);
  work.cut.clear();
  // Parts of clipped triangles may lie anywhere in the image.
  const bool whole = std::all_of(work.vertices.begin(), work.vertices.end(),
                                 [](const ScreenVertex& v) { return v.on_screen(); });
  const Rect drawn = whole ? covered_by(work.vertices, size) : Rect{0, 0, size.width, size.height};
  buffer.size = size;
  buffer.z.assign(static_cast<size_t>(size.pixels()), kNothing);
  const auto row = [&](int y) {
    return buffer.z.data() + static_cast<size_t>(y) * size.width + drawn.x0;
  };
  for (int y = drawn.y0; y < drawn.y0 + drawn.height; ++y) {
    std::fill_n(row(y), drawn.width, 0.0F);
  }
  draw_triangles(work.vertices, mesh.triangles, size, faces, buffer.z.data(), work.cut);
  if (!work.cut.empty()) {
    draw_cut(mesh, camera, work, buffer);
  }
  for (int y = drawn.y0; y < drawn.y0 + drawn.height; ++y) {
    invert(row(y), drawn.width);
  }
}

}  // namespace

DepthBuffer draw_depth(const Mesh& mesh, const CameraModel& camera, Faces faces) {
  Workspace work;
  DepthBuffer buffer;
  draw(mesh, camera, faces, work, buffer);
  return buffer;
}

void draw_depths(const Mesh& mesh, std::span<const CameraModel> cameras,
                 std::vector<DepthBuffer>& buffers, Faces faces) {
  buffers.resize(cameras.size());
  tbb::enumerable_thread_specific<Workspace> workspaces;
  tbb::parallel_for(size_t{0}, cameras.size(), [&](size_t i) {
    draw(mesh, cameras[i], faces, workspaces.local(), buffers[i]);
  });
}

}  // namespace v3d
