#include "recon/texture.h"

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>

#include "recon/depth_raster.h"

namespace v3d {
namespace {

/// What one camera says about one vertex: the paper's T_{v,c} and w_{v,c}; weight 0 = invisible.
struct Sighting {
  float weight = 0;
  bool on_rim = false;  ///< see touches_background()
  Eigen::Vector3f colour = Eigen::Vector3f::Zero();
};

/// The depth buffer of one camera, asked whether a vertex is hidden.
class Occlusion {
 public:
  Occlusion(const Mesh& mesh, const CameraModel& model, std::vector<ScreenVertex> screen,
            const TextureOptions& options)
      : tolerance_(options.depth_tolerance_m) {
    const CameraModel reduced = model.reduced(options.depth_reduction);
    reduce(screen, options.depth_reduction);
    pixel_ = 1 / reduced.matrix()(0, 0);
    most_slant_ = options.most_slant;
    buffer_ =
        draw_depth(mesh, model, screen, options.depth_reduction, reduced.size(), Sides::kFront);
  }

  /// `at`: on the full image; `facing`: cosine between the normal and the optical axis. The nearest
  /// of the four pixels round the vertex decides: at the edge of an occluder its colours must not
  /// leak onto what lies behind.
  bool hides(const ScreenVertex& at, float facing, int factor) const {
    const double x = (at.x + 0.5) / factor - 0.5, y = (at.y + 0.5) / factor - 0.5;
    const int x0 = std::clamp(static_cast<int>(std::floor(x)), 0, buffer_.size.width - 1);
    const int y0 = std::clamp(static_cast<int>(std::floor(y)), 0, buffer_.size.height - 1);
    const int x1 = std::min(x0 + 1, buffer_.size.width - 1);
    const int y1 = std::min(y0 + 1, buffer_.size.height - 1);
    const float nearest =
        std::min({buffer_.at(x0, y0), buffer_.at(x1, y0), buffer_.at(x0, y1), buffer_.at(x1, y1)});
    const double slope = std::sqrt(std::max(0.0F, 2 - 2 * facing * facing)) / facing;
    return at.z > nearest + tolerance_ + std::min(slope, most_slant_) * pixel_ * at.z;
  }

 private:
  double tolerance_;
  double pixel_ = 0;  ///< width of a pixel, metres per metre of distance
  double most_slant_ = 0;
  DepthBuffer buffer_;
};

std::vector<Sighting> look(const Mesh& mesh, const std::vector<Eigen::Vector3f>& normals,
                           const TextureCamera& camera, const TextureOptions& options) {
  const std::vector<ScreenVertex> screen = project_vertices(mesh, *camera.model);
  const Occlusion occlusion(mesh, *camera.model, screen, options);
  const Eigen::Vector3f axis = camera.model->viewing_direction().cast<float>();
  std::vector<Sighting> sightings(mesh.vertices.size());
  for (size_t v = 0; v < sightings.size(); ++v) {
    const float facing = -axis.dot(normals[v]);
    if (facing <= 0 || !screen[v].on_screen ||
        !camera.model->inside_image({screen[v].x, screen[v].y}) ||
        occlusion.hides(screen[v], facing, options.depth_reduction)) {
      continue;
    }
    if (const auto colour = sample_colour(*camera.frame, screen[v].x, screen[v].y)) {
      sightings[v] = {facing, touches_background(*camera.frame, screen[v].x, screen[v].y), *colour};
    }
  }
  return sightings;
}

Rgb8 rounded(const Eigen::Vector3f& c) {
  const auto byte = [](float x) {
    return static_cast<uint8_t>(std::clamp(x, 0.0F, 255.0F) + 0.5F);
  };
  return {byte(c.x()), byte(c.y()), byte(c.z())};
}

/// Equations (8) and (9) over the sightings on the rim, or those inside it. Empty when there are
/// none. The cameras are added in one order, so that the sum is one number.
std::optional<Rgb8> weighted_mean(const std::vector<std::vector<Sighting>>& sightings, size_t v,
                                  bool on_rim) {
  Eigen::Vector3f sum = Eigen::Vector3f::Zero();
  float weight = 0;
  for (const auto& of_camera : sightings) {
    if (of_camera[v].on_rim == on_rim) {
      sum += of_camera[v].weight * of_camera[v].colour;
      weight += of_camera[v].weight;
    }
  }
  return weight > 0 ? std::optional(rounded(sum / weight)) : std::nullopt;
}

void blend(const std::vector<std::vector<Sighting>>& sightings, std::vector<Rgb8>& colours,
           std::vector<uint8_t>& known) {
  tbb::parallel_for(tbb::blocked_range<size_t>(0, colours.size(), 4096), [&](const auto& range) {
    for (size_t v = range.begin(); v < range.end(); ++v) {
      auto colour = weighted_mean(sightings, v, false);
      if (!colour) {
        colour = weighted_mean(sightings, v, true);
      }
      if (colour) {
        colours[v] = *colour;
        known[v] = 1;
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
  std::vector<TextureCamera> ordered(cameras.begin(), cameras.end());
  std::sort(ordered.begin(), ordered.end(),
            [](const auto& a, const auto& b) { return a.frame->camera < b.frame->camera; });
  const std::vector<Eigen::Vector3f> normals = vertex_normals(mesh);
  std::vector<std::vector<Sighting>> sightings(ordered.size());
  tbb::parallel_for(size_t{0}, ordered.size(),
                    [&](size_t c) { sightings[c] = look(mesh, normals, ordered[c], options); });

  Texture texture;
  texture.colours.assign(mesh.vertices.size(), kUnseenColour);
  std::vector<uint8_t> known(mesh.vertices.size(), 0);
  blend(sightings, texture.colours, known);
  texture.unseen = std::count(known.begin(), known.end(), 0);
  fill_unseen(mesh, options.fill_passes, texture.colours, known);
  return texture;
}

}  // namespace v3d
