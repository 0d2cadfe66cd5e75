// Texture atlas: a square image with the colours of a surface, finer than colours of vertices.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <limits>
#include <vector>

#include "base/geometry/mesh.h"
#include "base/image/image.h"

namespace v3d::recon {

// Charts of a surface: parts that fit into a plane without overlap.

/// A part of a surface and the plane of its orthographic projection.
struct Chart {
  std::vector<uint32_t> triangles;  ///< of the mesh, ascending; not empty
  /// A few triangles inside the chart that its projection turns over or hides, as in small folds.
  std::vector<uint32_t> folded;
  /// Axes of the plane: perpendicular unit vectors, world. `right` x `up` points out of the
  /// surface.
  Eigen::Vector3f right{1, 0, 0}, up{0, 1, 0};
};

/// Divides the surface into connected charts. Every triangle is in one of them.
///
/// Each triangle prefers the nearest of 14 directions (axes and space diagonals) to the smoothed
/// normal of the surface; neighbours prefer the same one. Small parts join a neighbour. Triangles
/// that a projection would turn over or hide behind others get charts of their own, so the
/// projection of `triangles` is one to one down to `cell_m` metres (0: a third of the mean edge),
/// or to larger cells where the surface would have more than 2^24 of these, so that a crafted mesh
/// needs less than a gigabyte.
/// Only folds of a few triangles stay as `folded`: charts of their own would need many texels for
/// parts that hardly any camera sees. The axes give a chart a small bounding rectangle.
/// Deterministic. One thread.
std::vector<Chart> surface_charts(const Mesh& mesh, double cell_m = 0);

// Atlas of the charts.

struct AtlasOptions {
  int side = 2048;  ///< texels, 64 to kMaxAtlasSide
  /// Bound of the resolution: more texels than pixels of the cameras show nothing new.
  double max_texels_per_m = 1000;
  int gutter = 4;  ///< texels around every chart, so that filters do not mix charts
};
inline constexpr int kMinAtlasSide = 64, kMaxAtlasSide = 8192;

/// Where every triangle of a surface lies in an atlas. Positions are texels with (0, 0) in the
/// centre of the first texel; y grows downwards.
struct AtlasLayout {
  int side = 0;             ///< texels
  double texels_per_m = 0;  ///< of a surface parallel to its chart; 0 without triangles
  int charts = 0;
  std::vector<uint32_t> chart;  ///< one per triangle: the number of its chart
  std::vector<std::array<Eigen::Vector2f, 3>> corners;  ///< one per triangle, of its corners
  std::vector<uint8_t> folded;  ///< one per triangle: 1 for Chart::folded, which shows other texels
};

/// Packs surface_charts() with the highest resolution at which they fit. The layout is independent
/// of positions that change later, so one layout serves all pulses of a tracked segment. Throws
/// InputError when the charts and their gutters do not fit at any resolution.
AtlasLayout lay_out_atlas(const Mesh& mesh, const AtlasOptions& options = {});

struct TextureAtlas {
  AtlasLayout layout;
  Image image;  ///< RGB8, layout.side x layout.side
};

/// The colour at `position`, texels of the atlas, interpolated bilinearly. Requires RGB8 of at
/// least 2 x 2 texels.
Eigen::Vector3f sample_atlas(const Image& image, const Eigen::Vector2f& position);

/// The triangle that each texel shows.
struct AtlasTexels {
  static constexpr uint32_t kNone = std::numeric_limits<uint32_t>::max();
  int side = 0;
  std::vector<uint32_t> triangle;  ///< row by row, or kNone
};

/// Texels whose centres lie in a triangle that is not folded, and those within `margin` texels
/// (4-neighbours) of one, which a bilinear filter at the border of a chart reads, too.
AtlasTexels atlas_texels(const AtlasLayout& layout, int margin = 2);

/// Barycentric coordinates of `texel` in the triangle with these corners; also outside of it. Those
/// of the centre for a triangle without area.
Eigen::Vector3f barycentric(const std::array<Eigen::Vector2f, 3>& corners,
                            const Eigen::Vector2f& texel);

}  // namespace v3d::recon
