#include "recon/texture/atlas_colours.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <vector>

#include "base/core/error.h"
#include "base/image/colour.h"
#include "recon/mesh/mesh_neighbours.h"
#include "recon/visibility/point_depth_buffer.h"

namespace v3d::recon {

void ColourFilter::apply(std::span<uint8_t> colours, std::span<const uint8_t> seen) {
  V3D_CHECK(colours.size() == 3 * seen.size());
  if (shown_.size() != colours.size()) {
    shown_.assign(colours.begin(), colours.end());
    was_seen_.assign(seen.begin(), seen.end());
    return;
  }
  constexpr float kMinStep = 1.0F / 7, kNoise = 6, kChange = 40;
  for (size_t i = 0; i < was_seen_.size(); ++i) {
    const bool is_seen = seen[i] != 0;
    if (!is_seen && was_seen_[i] != 0) {
      for (size_t c = 3 * i; c < 3 * i + 3; ++c) {
        colours[c] = static_cast<uint8_t>(shown_[c] + 0.5F);
      }
      continue;
    }
    float change = 0;
    for (size_t c = 3 * i; c < 3 * i + 3; ++c) {
      change = std::max(change, std::abs(static_cast<float>(colours[c]) - shown_[c]));
    }
    const bool is_first = is_seen && was_seen_[i] == 0;
    const float step =
        is_first ? 1 : std::clamp((change - kNoise) / (kChange - kNoise), kMinStep, 1.0F);
    for (size_t c = 3 * i; c < 3 * i + 3; ++c) {
      shown_[c] += step * (static_cast<float>(colours[c]) - shown_[c]);
      colours[c] = static_cast<uint8_t>(shown_[c] + 0.5F);
    }
    was_seen_[i] = was_seen_[i] != 0 || is_seen;
  }
}

void ColourFilter::apply(std::vector<Rgb8>& colours, std::span<const uint8_t> seen) {
  static_assert(sizeof(Rgb8) == 3);
  if (colours.empty()) return;
  apply(std::span<uint8_t>(reinterpret_cast<uint8_t*>(colours.data()), 3 * colours.size()), seen);
}

namespace {

/// Texels of a surface and where they lie on it.
struct SurfaceTexels {
  std::vector<uint32_t> index;           ///< in the image, row by row
  std::vector<uint32_t> triangle;        ///< of the mesh
  std::vector<Eigen::Vector3f> weights;  ///< barycentric in the triangle
  PointArrays positions, normals;        ///< world, metres; unit vectors

  template <class T>
  T interpolated(const Mesh& mesh, size_t i, const std::vector<T>& at_vertices) const {
    const auto& [a, b, c] = mesh.triangles[triangle[i]];
    const Eigen::Vector3f& w = weights[i];
    return w.x() * at_vertices[a] + w.y() * at_vertices[b] + w.z() * at_vertices[c];
  }
};

SurfaceTexels surface_texels(const Mesh& mesh, const AtlasLayout& layout,
                             const std::vector<Eigen::Vector3f>& vertex_normals) {
  const AtlasTexels texels = atlas_texels(layout);
  SurfaceTexels surface;
  std::vector<Eigen::Vector3f> positions, normals;
  for (uint32_t i = 0; i < texels.triangle.size(); ++i) {
    const uint32_t t = texels.triangle[i];
    if (t == AtlasTexels::kNone) continue;
    const auto side = static_cast<uint32_t>(layout.side);
    const uint32_t column = i % side, row = i / side;
    const Eigen::Vector2f texel(static_cast<float>(column), static_cast<float>(row));
    surface.index.push_back(i);
    surface.triangle.push_back(t);
    surface.weights.push_back(barycentric(layout.corners[t], texel));
    const size_t last = surface.index.size() - 1;
    positions.push_back(surface.interpolated(mesh, last, mesh.vertices));
    normals.push_back(surface.interpolated(mesh, last, vertex_normals).stableNormalized());
  }
  surface.positions = PointArrays(positions);
  surface.normals = PointArrays(normals);
  return surface;
}

/// The foreground of an RGB image after a Gaussian filter that reads foreground alone.
class ForegroundFilter {
 public:
  explicit ForegroundFilter(float sigma_px) {
    const int reach = std::max(1, static_cast<int>(std::ceil(2.5F * sigma_px)));
    for (int i = -reach; i <= reach; ++i) {
      const float at = static_cast<float>(i) / sigma_px;
      kernel_.push_back(std::exp(-at * at / 2));
    }
  }

  Image filtered(const Image& image, const ColourMask& mask, Rect roi) const {
    const int width = image.size.width, height = image.size.height;
    std::vector<Pixel> pixels(static_cast<size_t>(width) * height, Pixel::Zero());
    for (int y = 0; y < height; ++y) {
      for (int x = 0; x < width; ++x) {
        if (!mask.foreground(roi.x0 + x, roi.y0 + y)) continue;
        const uint8_t* rgb = image.row(y) + 3 * x;
        pixels[static_cast<size_t>(y) * width + x] = Pixel(rgb[0], rgb[1], rgb[2], 1);
      }
    }
    const std::vector<Pixel> across = filtered_along(pixels, width, height, 1, width);
    const std::vector<Pixel> both = filtered_along(across, height, width, width, 1);
    Image result = image;
    for (size_t i = 0; i < both.size(); ++i) {
      if (both[i].w() <= 0) continue;
      const Pixel mean = both[i] / both[i].w();
      for (int c = 0; c < 3; ++c) result.bytes[3 * i + c] = static_cast<uint8_t>(mean[c] + 0.5F);
    }
    return result;
  }

 private:
  using Pixel = Eigen::Vector4f;  ///< red, green, blue times weight, and weight

  /// `lines` lines of `length` pixels, which are `step` apart; lines are `line_step` apart.
  std::vector<Pixel> filtered_along(const std::vector<Pixel>& from, int length, int lines, int step,
                                    int line_step) const {
    const int reach = static_cast<int>(kernel_.size()) / 2;
    std::vector<Pixel> to(from.size());
    for (int line = 0; line < lines; ++line) {
      for (int i = 0; i < length; ++i) {
        Pixel sum = Pixel::Zero();
        for (int k = std::max(0, i - reach); k <= std::min(length - 1, i + reach); ++k) {
          sum += kernel_[k - i + reach] *
                 from[static_cast<size_t>(line) * line_step + static_cast<size_t>(k) * step];
        }
        to[static_cast<size_t>(line) * line_step + static_cast<size_t>(i) * step] = sum;
      }
    }
    return to;
  }

  std::vector<float> kernel_;
};

/// A camera for two bands of its image.
struct AtlasCamera {
  VertexCamera sharp, blurred;
  std::vector<float> share;  ///< one per vertex: 0 where the camera does not see it, at most 1
};

/// Which vertices the camera sees as ColourMask::inner().
std::vector<uint8_t> seen_vertices(const VertexCamera& camera, const PointArrays& vertices,
                                   const PointArrays& normals) {
  std::vector<uint8_t> seen(vertices.count, 0);
  for (size_t block = 0; block < vertices.blocks(); ++block) {
    const size_t first = block * PointArrays::kBlock;
    ColourSums sums;
    accumulate_vertex_colours(camera, vertices, normals, first, sums);
    for (size_t v = first; v < std::min(seen.size(), first + PointArrays::kBlock); ++v) {
      seen[v] = sums.inner[v - first][3] > 0;
    }
  }
  return seen;
}

/// The distance from the nearest unseen vertex, in edges, up to `fade_edges`, where it is 1.
std::vector<float> faded(const Neighbours& neighbours, const std::vector<uint8_t>& seen,
                         int fade_edges) {
  std::vector<int> distance(seen.size());
  std::transform(seen.begin(), seen.end(), distance.begin(),
                 [&](uint8_t s) { return s ? fade_edges : 0; });
  for (int pass = 1; pass < fade_edges; ++pass) {
    for (size_t v = 0; v < seen.size(); ++v) {
      if (distance[v] <= pass) continue;
      for (const uint32_t n : neighbours.of(v)) {
        if (distance[n] == pass - 1) distance[v] = pass;
      }
    }
  }
  std::vector<float> share(seen.size());
  std::transform(distance.begin(), distance.end(), share.begin(), [&](int d) {
    return static_cast<float>(d) / static_cast<float>(std::max(1, fade_edges));
  });
  return share;
}

std::vector<AtlasCamera> atlas_cameras(const Mesh& mesh,
                                       const std::vector<Eigen::Vector3f>& vertex_normals,
                                       std::span<const TextureCamera> cameras,
                                       const AtlasColourOptions& options) {
  const PointArrays occluders(occluding_points(
      options.occluder == nullptr ? mesh : *options.occluder, options.sampling.occluder_radius_m));
  const PointArrays vertices(mesh.vertices), normals(vertex_normals);
  const Neighbours neighbours(mesh);
  TextureOptions sampling = options.sampling;
  sampling.demosaic = true;
  std::vector<VertexCamera> prepared =
      vertex_cameras(occluders, {cameras.begin(), cameras.end()}, sampling);
  std::vector<AtlasCamera> result(prepared.size());
  tbb::parallel_for(size_t{0}, prepared.size(), [&](size_t c) {
    AtlasCamera& camera = result[c];
    camera.sharp = std::move(prepared[c]);
    camera.share =
        faded(neighbours, seen_vertices(camera.sharp, vertices, normals), options.fade_edges);
    if (options.detail_px <= 0) return;
    camera.blurred = camera.sharp;
    camera.blurred.demosaiced =
        ForegroundFilter(options.detail_px)
            .filtered(*camera.sharp.demosaiced, camera.sharp.mask, camera.sharp.frame->roi);
  });
  return result;
}

/// Weighted sums of one texel over cameras.
struct TexelSums {
  Eigen::Vector3f base = Eigen::Vector3f::Zero(), detail = base, rim = base;
  float base_weight = 0, detail_weight = 0, rim_weight = 0;

  std::optional<Eigen::Vector3f> colour() const {
    if (base_weight > 0) {
      Eigen::Vector3f colour = base / base_weight;
      if (detail_weight > 0) colour += detail / detail_weight;
      return colour;
    }
    if (rim_weight > 0) return Eigen::Vector3f(rim / rim_weight);
    return {};
  }
};

/// A camera that fades out still counts where no other sees the surface.
constexpr float kMinShare = 1e-3F;

void add_camera(const Mesh& mesh, const SurfaceTexels& surface, const AtlasCamera& camera,
                const AtlasColourOptions& options, size_t first, std::span<TexelSums> sums) {
  ColourSums sharp, blurred;
  accumulate_vertex_colours(camera.sharp, surface.positions, surface.normals, first, sharp);
  const bool in_bands = options.detail_px > 0;
  if (in_bands) {
    accumulate_vertex_colours(camera.blurred, surface.positions, surface.normals, first, blurred);
  }
  for (size_t i = 0; i < sums.size(); ++i) {
    const auto& [r, g, b, weight] = sharp.inner[i];
    const auto& rim = sharp.rim[i];
    sums[i].rim += Eigen::Vector3f(rim[0], rim[1], rim[2]);
    sums[i].rim_weight += rim[3];
    if (weight <= 0) continue;
    const float share = std::max(kMinShare, surface.interpolated(mesh, first + i, camera.share));
    const Eigen::Vector3f colour = Eigen::Vector3f(r, g, b) / weight;
    const auto& low = blurred.inner[i];
    const Eigen::Vector3f base =
        in_bands ? Eigen::Vector3f(Eigen::Vector3f(low[0], low[1], low[2]) / low[3]) : colour;
    const float detail_weight = share * std::pow(weight, options.detail_sharpness);
    sums[i].base += share * weight * base;
    sums[i].base_weight += share * weight;
    sums[i].detail += detail_weight * (colour - base);
    sums[i].detail_weight += detail_weight;
  }
}

Eigen::Vector3f vertex_colour(const Mesh& mesh, uint32_t v) {
  const Rgb8 c = mesh.colours.empty() ? kUnseenColour : mesh.colours[v];
  return {float(c.r), float(c.g), float(c.b)};
}

void set_texel(Image& image, size_t index, const Eigen::Vector3f& colour) {
  for (int c = 0; c < 3; ++c) {
    image.bytes[3 * index + c] = static_cast<uint8_t>(std::clamp(colour[c], 0.0F, 255.0F) + 0.5F);
  }
}

struct KnownTexels {
  Image image;
  std::vector<uint8_t> known;  ///< row by row
};

/// The image at half its size, rounded up: texels with the mean of their known ones.
KnownTexels halved(const Image& image, const std::vector<uint8_t>& known) {
  const int side = image.size.width, half = (side + 1) / 2;
  KnownTexels coarse{Image({half, half}, PixelFormat::kRGB8),
                     std::vector<uint8_t>(static_cast<size_t>(half) * half, 0)};
  for (size_t i = 0; i < coarse.known.size(); ++i) {
    const int x = 2 * static_cast<int>(i % static_cast<size_t>(half));
    const int y = 2 * static_cast<int>(i / static_cast<size_t>(half));
    std::array<int, 3> sum{};
    int count = 0;
    for (int k = 0; k < 4; ++k) {
      const int u = x + k % 2, v = y + k / 2;
      if (u >= side || v >= side) continue;
      const size_t at = static_cast<size_t>(v) * side + u;
      if (!known[at]) continue;
      for (size_t c = 0; c < 3; ++c) sum[c] += image.bytes[3 * at + c];
      ++count;
    }
    if (count == 0) continue;
    coarse.known[i] = 1;
    for (size_t c = 0; c < 3; ++c) {
      coarse.image.bytes[3 * i + c] = static_cast<uint8_t>((sum[c] + count / 2) / count);
    }
  }
  return coarse;
}

/// Colours texels without a surface with the mean of known ones around them, in a pyramid of half
/// the size from level to level. Video encoders need few bits for such an image.
void fill_background(Image& image, std::vector<uint8_t>& known) {
  const int side = image.size.width;
  if (side < 3) return;  // sample_atlas() needs 2 x 2 texels
  if (std::ranges::find(known, 0) == known.end()) return;
  KnownTexels coarse = halved(image, known);
  fill_background(coarse.image, coarse.known);
  for (int y = 0; y < side; ++y) {
    for (int x = 0; x < side; ++x) {
      const size_t i = static_cast<size_t>(y) * side + x;
      if (known[i]) continue;
      const Eigen::Vector2f at(static_cast<float>(x), static_cast<float>(y));
      set_texel(image, i, sample_atlas(coarse.image, at / 2 - Eigen::Vector2f::Constant(0.25F)));
    }
  }
}

}  // namespace

AtlasColours colour_atlas(const Mesh& mesh, const AtlasLayout& layout,
                          std::span<const TextureCamera> cameras,
                          const AtlasColourOptions& options) {
  AtlasColours atlas;
  atlas.image = Image({layout.side, layout.side}, PixelFormat::kRGB8);
  atlas.seen.assign(atlas.image.bytes.size() / 3, 0);
  const std::vector<Eigen::Vector3f> normals = vertex_normals(mesh);
  const SurfaceTexels surface = surface_texels(mesh, layout, normals);
  if (surface.index.empty()) return atlas;
  const std::vector<AtlasCamera> prepared = atlas_cameras(mesh, normals, cameras, options);
  std::vector<uint8_t> known(atlas.seen.size(), 0);
  tbb::parallel_for(size_t{0}, surface.positions.blocks(), [&](size_t block) {
    const size_t first = block * PointArrays::kBlock;
    std::vector<TexelSums> sums(std::min(PointArrays::kBlock, surface.index.size() - first));
    for (const AtlasCamera& camera : prepared) {
      add_camera(mesh, surface, camera, options, first, sums);
    }
    for (size_t i = 0; i < sums.size(); ++i) {
      const auto colour = sums[i].colour();
      atlas.seen[surface.index[first + i]] = colour.has_value();
      const auto& [a, b, c] = mesh.triangles[surface.triangle[first + i]];
      const Eigen::Vector3f& w = surface.weights[first + i];
      set_texel(
          atlas.image, surface.index[first + i],
          colour ? *colour
                 : Eigen::Vector3f(w.x() * vertex_colour(mesh, a) + w.y() * vertex_colour(mesh, b) +
                                   w.z() * vertex_colour(mesh, c)));
      known[surface.index[first + i]] = 1;
    }
  });
  atlas.texels = std::ssize(surface.index);
  atlas.unseen = atlas.texels - std::count(atlas.seen.begin(), atlas.seen.end(), 1);
  fill_background(atlas.image, known);
  return atlas;
}

}  // namespace v3d::recon
