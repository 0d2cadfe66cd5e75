#include "recon/texture/texture.h"

#include <tbb/parallel_for.h>
#include <tbb/parallel_invoke.h>

#include <algorithm>
#include <cmath>

#include "recon/texture/vertex_cameras.h"
#include "recon/visibility/surface_points.h"

namespace v3d {
namespace {

Rgb8 rounded(const Eigen::Vector3f& c) {
  const auto byte = [](float x) {
    return static_cast<uint8_t>(std::clamp(x, 0.0F, 255.0F) + 0.5F);
  };
  return {byte(c.x()), byte(c.y()), byte(c.z())};
}

/// Equations (8) and (9) for the i-th vertex of the block. Empty when no camera sees it.
std::optional<Rgb8> weighted_mean(const ColourSums::Sums& sums, size_t i) {
  const auto& [r, g, b, weight] = sums[i];
  const Eigen::Vector3f colour(r, g, b);
  return weight > 0 ? std::optional(rounded(colour / weight)) : std::nullopt;
}

/// Number of blocks that one camera processes before the next camera. Neighbouring blocks are close
/// to each other in the image, so its pixels are still in the cache.
constexpr size_t kGroup = 8;

/// Colours of the vertices of a block, from `first` on.
void finish_block(const ColourSums& sums, size_t first, std::vector<Rgb8>& colours,
                  std::vector<uint8_t>& known) {
  const size_t count = std::min(PointArrays::kBlock, colours.size() - first);
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
}

/// Adds the cameras in a fixed order, because float sums depend on it.
void blend(const std::vector<VertexCamera>& cameras, const PointArrays& vertices,
           const PointArrays& normals, std::vector<Rgb8>& colours, std::vector<uint8_t>& known) {
  const size_t groups = (vertices.blocks() + kGroup - 1) / kGroup;
  tbb::parallel_for(size_t{0}, groups, [&](size_t group) {
    const size_t first = group * kGroup;
    std::vector<ColourSums> sums(std::min(kGroup, vertices.blocks() - first));
    for (const VertexCamera& camera : cameras) {
      for (size_t b = 0; b < sums.size(); ++b) {
        accumulate_vertex_colours(camera, vertices, normals, (first + b) * PointArrays::kBlock,
                                  sums[b]);
      }
    }
    for (size_t b = 0; b < sums.size(); ++b) {
      finish_block(sums[b], (first + b) * PointArrays::kBlock, colours, known);
    }
  });
}

/// The triangles with a vertex of unknown colour. Only these change during the fill.
std::vector<std::array<uint32_t, 3>> unfinished(const std::vector<std::array<uint32_t, 3>>& from,
                                                const std::vector<uint8_t>& known) {
  std::vector<std::array<uint32_t, 3>> result;
  std::copy_if(from.begin(), from.end(), std::back_inserter(result),
               [&](const auto& t) { return !known[t[0]] || !known[t[1]] || !known[t[2]]; });
  return result;
}

/// One pass: unknown vertices get the mean of the known corners of their triangles. Sums are
/// integers, and a pass reads only results of the previous one, so the order has no influence.
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
  PointArrays vertices, normals, occluders;
  tbb::parallel_invoke([&] { normals = PointArrays(vertex_normals(mesh)); },
                       [&] {
                         vertices = PointArrays(mesh.vertices);
                         occluders = PointArrays(occluding_points(mesh, options.occluder_radius_m));
                       });
  const std::vector<VertexCamera> prepared =
      vertex_cameras(occluders, {cameras.begin(), cameras.end()}, options);
  Texture texture;
  texture.colours.assign(mesh.vertices.size(), kUnseenColour);
  std::vector<uint8_t> known(mesh.vertices.size(), 0);
  blend(prepared, vertices, normals, texture.colours, known);
  texture.unseen = std::count(known.begin(), known.end(), 0);
  fill_unseen(mesh, options.fill_passes, texture.colours, known);
  return texture;
}

}  // namespace v3d
