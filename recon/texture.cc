#include "recon/texture.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>

#include "recon/occluders.h"
#include "recon/see_vertices.h"

namespace v3d {
namespace {

/// A grid whose voxel indices are metres.
const VoxelGrid kMetres{Eigen::Vector3d::Constant(-0.5), 1, {}};

Eigen::Vector3f centroid(const std::vector<Eigen::Vector3f>& points) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3f& p : points) {
    sum += p.cast<double>();
  }
  return points.empty() ? Eigen::Vector3f::Zero()
                        : Eigen::Vector3f((sum / static_cast<double>(points.size())).cast<float>());
}

/// Depth cells and masks for the cameras that have pixels, in the order of their names.
std::vector<VertexCamera> prepare(const Mesh& mesh, std::vector<TextureCamera> cameras,
                                  const TextureOptions& options) {
  std::erase_if(cameras, [](const TextureCamera& c) { return c.frame->roi.empty(); });
  std::sort(cameras.begin(), cameras.end(),
            [](const auto& a, const auto& b) { return a.frame->camera < b.frame->camera; });
  const std::vector<Eigen::Vector3f> occluders = occluding_points(mesh, options.occluder_radius_m);
  const PointArrays points(occluders);
  const Eigen::Vector3f middle = centroid(occluders);
  std::vector<VertexCamera> prepared(cameras.size());
  tbb::parallel_for(size_t{0}, cameras.size(), [&](size_t c) {
    const CameraModel& model = *cameras[c].model;
    VertexCamera& camera = prepared[c];
    camera.lens = VoxelCamera(model, kMetres);
    camera.axis = model.viewing_direction().cast<float>();
    camera.frame = cameras[c].frame;
    camera.mask = ColourMask(*camera.frame);
    camera.depth = DepthCells(points, middle, options.occluder_radius_m, model, camera.lens,
                              camera.frame->roi);
    camera.tolerance_m = static_cast<float>(options.depth_tolerance_m);
    camera.most_slant = static_cast<float>(options.most_slant);
    camera.cell_m_per_m =
        camera.depth.grid().cell_width() / static_cast<float>(model.matrix()(0, 0));
  });
  return prepared;
}

Rgb8 rounded(const Eigen::Vector3f& c) {
  const auto byte = [](float x) {
    return static_cast<uint8_t>(std::clamp(x, 0.0F, 255.0F) + 0.5F);
  };
  return {byte(c.x()), byte(c.y()), byte(c.z())};
}

/// Equations (8) and (9) of the block's i-th vertex. Empty when no camera sees it.
std::optional<Rgb8> weighted_mean(const ColourSums::Sums& sums, size_t i) {
  const auto& [r, g, b, weight] = sums[i];
  const Eigen::Vector3f colour(r, g, b);
  return weight > 0 ? std::optional(rounded(colour / weight)) : std::nullopt;
}

/// The cameras are added in one order, so that the sum is one number.
void blend(const std::vector<VertexCamera>& cameras, const Mesh& mesh, std::vector<Rgb8>& colours,
           std::vector<uint8_t>& known) {
  const PointArrays vertices(mesh.vertices), normals(vertex_normals(mesh));
  tbb::parallel_for(size_t{0}, vertices.blocks(), [&](size_t block) {
    const size_t first = block * PointArrays::kBlock;
    ColourSums sums;
    for (const VertexCamera& camera : cameras) {
      see_vertices(camera, vertices, normals, first, sums);
    }
    const size_t count = std::min(PointArrays::kBlock, vertices.count - first);
    for (size_t i = 0; i < count; ++i) {
      auto colour = weighted_mean(sums.inner, i);
      if (!colour) {
        colour = weighted_mean(sums.rim, i);
      }
      if (colour) {
        colours[first + i] = *colour;
        known[first + i] = 1;
      }
    }
  });
}

/// The triangles that touch a vertex nobody has seen: all that the fill needs to look at.
std::vector<std::array<uint32_t, 3>> unfinished(const std::vector<std::array<uint32_t, 3>>& from,
                                                const std::vector<uint8_t>& known) {
  std::vector<std::array<uint32_t, 3>> result;
  std::copy_if(from.begin(), from.end(), std::back_inserter(result),
               [&](const auto& t) { return !known[t[0]] || !known[t[1]] || !known[t[2]]; });
  return result;
}

/// One pass: unknown vertices take the mean of the known corners of their triangles. Sums are whole
/// numbers and the pass reads only what the pass before wrote: any order gives the same.
bool spread(const std::vector<std::array<uint32_t, 3>>& triangles, std::vector<Rgb8>& colours,
            std::vector<uint8_t>& known, std::vector<std::array<uint32_t, 4>>& sums) {
  for (const auto& t : triangles) {
    for (int k = 0; k < 3; ++k) {
      for (int other = 1; other < 3 && !known[t[k]]; ++other) {
        const uint32_t n = t[(k + other) % 3];
        if (known[n]) {
          auto& [r, g, b, count] = sums[t[k]];
          r += colours[n].r, g += colours[n].g, b += colours[n].b, ++count;
        }
      }
    }
  }
  bool changed = false;
  for (const auto& t : triangles) {
    for (const uint32_t v : t) {
      if (const auto [r, g, b, count] = sums[v]; !known[v] && count > 0) {
        const auto mean = [n = count](uint32_t sum) {
          return static_cast<uint8_t>((sum + n / 2) / n);
        };
        colours[v] = {mean(r), mean(g), mean(b)};
        known[v] = 1;
        changed = true;
      }
    }
  }
  return changed;
}

void fill_unseen(const Mesh& mesh, int passes, std::vector<Rgb8>& colours,
                 std::vector<uint8_t>& known) {
  auto triangles = unfinished(mesh.triangles, known);
  std::vector<std::array<uint32_t, 4>> sums(colours.size());
  for (int pass = 0; pass < passes && spread(triangles, colours, known, sums); ++pass) {
    triangles = unfinished(triangles, known);
  }
}

}  // namespace

Texture colour_vertices(const Mesh& mesh, std::span<const TextureCamera> cameras,
                        const TextureOptions& options) {
  const std::vector<VertexCamera> prepared =
      prepare(mesh, {cameras.begin(), cameras.end()}, options);
  Texture texture;
  texture.colours.assign(mesh.vertices.size(), kUnseenColour);
  std::vector<uint8_t> known(mesh.vertices.size(), 0);
  blend(prepared, mesh, texture.colours, known);
  texture.unseen = std::count(known.begin(), known.end(), 0);
  fill_unseen(mesh, options.fill_passes, texture.colours, known);
  return texture;
}

}  // namespace v3d
