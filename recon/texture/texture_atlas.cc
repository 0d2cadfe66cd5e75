#include "recon/texture/texture_atlas.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <string>

#include "base/core/error.h"
#include "recon/render/rasteriser.h"

// The packer is a header; only this file uses it.
#define STB_RECT_PACK_IMPLEMENTATION
#define STBRP_STATIC
#include <stb/stb_rect_pack.h>

namespace v3d::recon {
namespace {

/// A chart in its plane.
struct FlatChart {
  Eigen::Vector2f low, size;  ///< metres
};

FlatChart flatten(const Mesh& mesh, const Chart& chart) {
  Eigen::Vector2f low = Eigen::Vector2f::Constant(std::numeric_limits<float>::infinity());
  Eigen::Vector2f high = -low;
  for (const auto* triangles : {&chart.triangles, &chart.folded}) {
    for (const uint32_t t : *triangles) {
      for (const uint32_t v : mesh.triangles[t]) {
        const Eigen::Vector2f p(mesh.vertices[v].dot(chart.right), mesh.vertices[v].dot(chart.up));
        low = low.cwiseMin(p);
        high = high.cwiseMax(p);
      }
    }
  }
  return {low, high - low};
}

/// The upper left texel of every chart with its gutter; empty when they do not fit.
std::optional<std::vector<Eigen::Vector2i>> pack(const std::vector<FlatChart>& charts,
                                                 double texels_per_m, const AtlasOptions& options) {
  std::vector<stbrp_rect> rects(charts.size());
  for (size_t i = 0; i < charts.size(); ++i) {
    // One texel more than the distance between the first and the last.
    const auto texels = [&](float metres) {
      const double length = std::min(std::ceil(metres * texels_per_m), double{kMaxAtlasSide});
      return static_cast<int>(length) + 1 + 2 * options.gutter;
    };
    rects[i].id = static_cast<int>(i);
    rects[i].w = texels(charts[i].size.x());
    rects[i].h = texels(charts[i].size.y());
    if (rects[i].w > options.side || rects[i].h > options.side) return {};
  }
  stbrp_context context;
  std::vector<stbrp_node> nodes(static_cast<size_t>(options.side));
  stbrp_init_target(&context, options.side, options.side, nodes.data(), options.side);
  if (stbrp_pack_rects(&context, rects.data(), static_cast<int>(rects.size())) == 0) return {};
  std::vector<Eigen::Vector2i> origins(charts.size());
  for (const stbrp_rect& rect : rects) origins[static_cast<size_t>(rect.id)] = {rect.x, rect.y};
  return origins;
}

struct Packing {
  double texels_per_m = 0;
  std::vector<Eigen::Vector2i> origins;
};

/// The highest resolution that fits, within a hundredth.
Packing pack_tightly(const std::vector<FlatChart>& charts, const AtlasOptions& options) {
  if (auto origins = pack(charts, options.max_texels_per_m, options)) {
    return {options.max_texels_per_m, std::move(*origins)};
  }
  Packing best;
  double low = 0, high = options.max_texels_per_m;
  if (auto origins = pack(charts, low, options)) best.origins = std::move(*origins);
  if (best.origins.empty()) {
    throw InputError("texture atlas of " + std::to_string(options.side) +
                     " texels: " + std::to_string(charts.size()) +
                     " charts do not fit; expected a larger atlas, or a mesh in fewer pieces");
  }
  while (high - low > 0.01 * high && high > 1e-3) {
    const double middle = (low + high) / 2;
    if (auto origins = pack(charts, middle, options)) {
      best = {middle, std::move(*origins)};
      low = middle;
    } else {
      high = middle;
    }
  }
  return best;
}

}  // namespace

AtlasLayout lay_out_atlas(const Mesh& mesh, const AtlasOptions& options) {
  if (options.side < kMinAtlasSide || options.side > kMaxAtlasSide) {
    throw InputError("texture atlas of " + std::to_string(options.side) + " texels: expected " +
                     std::to_string(kMinAtlasSide) + " to " + std::to_string(kMaxAtlasSide));
  }
  AtlasLayout layout;
  layout.side = options.side;
  const std::vector<Chart> charts = surface_charts(mesh);
  if (charts.empty()) return layout;
  std::vector<FlatChart> flat;
  flat.reserve(charts.size());
  for (const Chart& chart : charts) flat.push_back(flatten(mesh, chart));
  const Packing packing = pack_tightly(flat, options);
  layout.texels_per_m = packing.texels_per_m;
  layout.charts = static_cast<int>(charts.size());
  layout.chart.resize(mesh.triangles.size());
  layout.corners.resize(mesh.triangles.size());
  layout.folded.resize(mesh.triangles.size(), 0);
  const auto scale = static_cast<float>(packing.texels_per_m);
  for (uint32_t c = 0; c < charts.size(); ++c) {
    const Eigen::Vector2f origin =
        (packing.origins[c].array() + options.gutter).matrix().cast<float>();
    const auto place = [&](uint32_t t) {
      layout.chart[t] = c;
      for (int k = 0; k < 3; ++k) {
        const Eigen::Vector3f& p = mesh.vertices[mesh.triangles[t][k]];
        const Eigen::Vector2f at =
            Eigen::Vector2f(p.dot(charts[c].right), p.dot(charts[c].up)) - flat[c].low;
        // Rows grow downwards.
        layout.corners[t][k] = origin + scale * Eigen::Vector2f(at.x(), flat[c].size.y() - at.y());
      }
    };
    std::ranges::for_each(charts[c].triangles, place);
    for (const uint32_t t : charts[c].folded) {
      place(t);
      layout.folded[t] = 1;
    }
  }
  return layout;
}

AtlasTexels atlas_texels(const AtlasLayout& layout, int margin) {
  AtlasTexels texels{layout.side, {}};
  const auto side = static_cast<size_t>(layout.side);
  texels.triangle.assign(side * side, AtlasTexels::kNone);
  for (uint32_t t = 0; t < layout.corners.size(); ++t) {
    if (layout.folded[t] != 0) continue;
    std::array<ScreenVertex, 3> corner;
    for (int k = 0; k < 3; ++k) {
      corner[k].x = layout.corners[t][k].x();
      corner[k].y = layout.corners[t][k].y();
    }
    for_each_span(corner, Band{layout.side, 0, layout.side}, [&](int y, int begin, int end) {
      std::fill_n(texels.triangle.begin() + static_cast<ptrdiff_t>(y * side + begin), end - begin,
                  t);
    });
  }
  for (int pass = 0; pass < margin; ++pass) {
    const std::vector<uint32_t> before = texels.triangle;
    const auto spread_from = [&](size_t to, size_t from) {
      if (texels.triangle[to] == AtlasTexels::kNone) texels.triangle[to] = before[from];
    };
    for (size_t i = 0; i < before.size(); ++i) {
      if (before[i] != AtlasTexels::kNone) continue;
      const size_t x = i % side, y = i / side;
      if (x > 0) spread_from(i, i - 1);
      if (x + 1 < side) spread_from(i, i + 1);
      if (y > 0) spread_from(i, i - side);
      if (y + 1 < side) spread_from(i, i + side);
    }
  }
  return texels;
}

Eigen::Vector3f barycentric(const std::array<Eigen::Vector2f, 3>& corners,
                            const Eigen::Vector2f& texel) {
  const auto cross = [](const Eigen::Vector2f& a, const Eigen::Vector2f& b) {
    return a.x() * b.y() - a.y() * b.x();
  };
  const Eigen::Vector2f ab = corners[1] - corners[0], ac = corners[2] - corners[0];
  const float area = cross(ab, ac);
  if (std::abs(area) < 1e-6F) return Eigen::Vector3f::Constant(1.0F / 3);
  const Eigen::Vector2f ap = texel - corners[0];
  const float b = cross(ap, ac) / area, c = cross(ab, ap) / area;
  return {1 - b - c, b, c};
}

Eigen::Vector3f sample_atlas(const Image& image, const Eigen::Vector2f& position) {
  const auto last = static_cast<float>(image.size.width - 1);
  const Eigen::Vector2f at = position.cwiseMax(0).cwiseMin(last);
  const int x = std::min(static_cast<int>(at.x()), std::max(0, image.size.width - 2));
  const int y = std::min(static_cast<int>(at.y()), std::max(0, image.size.height - 2));
  const float u = at.x() - static_cast<float>(x), v = at.y() - static_cast<float>(y);
  const auto pixel = [&](int i, int j) {
    const uint8_t* rgb = image.row(j) + 3 * i;
    return Eigen::Vector3f(rgb[0], rgb[1], rgb[2]);
  };
  return (1 - v) * ((1 - u) * pixel(x, y) + u * pixel(x + 1, y)) +
         v * ((1 - u) * pixel(x, y + 1) + u * pixel(x + 1, y + 1));
}

}  // namespace v3d::recon
