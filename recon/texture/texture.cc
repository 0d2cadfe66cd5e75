#include "recon/texture/texture.h"

#include <tbb/parallel_for.h>
#include <tbb/parallel_invoke.h>

#include <algorithm>
#include <cmath>

#include "base/image/colour.h"
#include "recon/visibility/point_depth_buffer.h"

namespace v3d::recon {

Rgb8 rounded_colour(const Eigen::Vector3f& colour) {
  const auto byte = [](float x) {
    return static_cast<uint8_t>(std::clamp(x, 0.0F, 255.0F) + 0.5F);
  };
  return {byte(colour.x()), byte(colour.y()), byte(colour.z())};
}

namespace {

/// Equations (8) and (9) for the i-th vertex of the block. Empty when no camera sees it.
std::optional<Rgb8> weighted_mean(const ColourSums::Sums& sums, size_t i) {
  const auto& [r, g, b, weight] = sums[i];
  const Eigen::Vector3f colour(r, g, b);
  return weight > 0 ? std::optional(rounded_colour(colour / weight)) : std::nullopt;
}

/// Number of blocks that one camera processes before the next camera. Neighbouring blocks are close
/// to each other in the image, so its pixels are still in the cache.
constexpr size_t kGroup = 8;

/// Colours of the vertices of a block, from `first` on. A vertex whose samples all equal the
/// background gets their colour, but it is not `known`: fill_unseen() replaces the colour where it
/// can.
void finish_block(const ColourSums& sums, size_t first, Texture& texture,
                  std::vector<uint8_t>& known) {
  std::vector<Rgb8>& colours = texture.colours;
  const size_t count = std::min(PointArrays::kBlock, colours.size() - first);
  for (size_t i = 0; i < count; ++i) {
    auto colour = weighted_mean(sums.inner, i);
    texture.seen[first + i] = colour.has_value();
    if (!colour) {
      colour = weighted_mean(sums.rim, i);
    }
    if (colour) {
      colours[first + i] = *colour;
      known[first + i] = 1;
    } else if (const auto background_like = weighted_mean(sums.background_like, i)) {
      colours[first + i] = *background_like;
    }
  }
}

/// Adds the cameras in a fixed order, because float sums depend on it.
void blend(const std::vector<VertexCamera>& cameras, const PointArrays& vertices,
           const PointArrays& normals, Texture& texture, std::vector<uint8_t>& known) {
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
      finish_block(sums[b], (first + b) * PointArrays::kBlock, texture, known);
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
  texture.seen.assign(mesh.vertices.size(), 0);
  std::vector<uint8_t> known(mesh.vertices.size(), 0);
  blend(prepared, vertices, normals, texture, known);
  texture.unseen = std::count(known.begin(), known.end(), 0);
  fill_unseen(mesh, options.fill_passes, texture.colours, known);
  return texture;
}

namespace {

Eigen::Vector3f centroid(const PointArrays& points) {
  if (points.count == 0) {
    return Eigen::Vector3f::Zero();
  }
  const auto mean = [&](const std::vector<float>& array) {
    double sum = 0;
    for (size_t i = 0; i < points.count; ++i) {
      sum += array[i];
    }
    return static_cast<float>(sum / static_cast<double>(points.count));
  };
  return {mean(points.x), mean(points.y), mean(points.z)};
}

/// Resolution of a typical camera on the surface: weights by resolution are about 1.
constexpr float kUsualPixelsPerMetre = 300;

}  // namespace

float blending_weight(const Eigen::Vector3d& axis, const ViewDependence& eye) {
  const double cosine = eye.direction.dot(axis);
  return static_cast<float>(std::pow((cosine + 2) / 3, eye.sharpness));
}

std::vector<VertexCamera> vertex_cameras(const PointArrays& occluders,
                                         std::vector<TextureCamera> cameras,
                                         const TextureOptions& options) {
  std::erase_if(cameras, [](const TextureCamera& c) { return c.frame->roi.empty(); });
  std::sort(cameras.begin(), cameras.end(),
            [](const auto& a, const auto& b) { return a.frame->camera < b.frame->camera; });
  const Eigen::Vector3f middle = centroid(occluders);
  std::vector<VertexCamera> prepared(cameras.size());
  tbb::parallel_for(size_t{0}, cameras.size(), [&](size_t c) {
    const CameraModel& model = *cameras[c].model;
    VertexCamera& camera = prepared[c];
    camera.lens = camera_of_metres(model);
    camera.axis = model.viewing_direction().cast<float>();
    camera.frame = cameras[c].frame;
    if (options.demosaic) camera.demosaiced = to_rgb(camera.frame->image.view());
    camera.mask = ColourMask(*camera.frame);
    if (const ColourResponse* colour = cameras[c].colour; colour && !colour->is_identity()) {
      camera.colour = SampleCorrection(*colour);
    }
    if (options.view) camera.weight = blending_weight(model.viewing_direction(), *options.view);
    if (options.by_resolution) {
      camera.resolution = static_cast<float>(model.matrix()(0, 0)) / kUsualPixelsPerMetre;
    }
    camera.depth = PointDepthBuffer(occluders, middle, options.occluder_radius_m, model,
                                    camera.lens, camera.frame->roi);
    camera.tolerance_m = static_cast<float>(options.depth_tolerance_m);
    camera.max_slant = static_cast<float>(options.max_slant);
    camera.cell_m_per_m =
        camera.depth.grid().cell_width() / static_cast<float>(model.matrix()(0, 0));
  });
  return prepared;
}

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

namespace {

codec::CameraAxis coded_axis(const Eigen::Vector3d& axis) {
  codec::CameraAxis coded;
  for (int n = 0; n < 3; ++n) {
    coded[static_cast<size_t>(n)] = static_cast<int16_t>(std::lround(axis[n] * codec::kAxisUnits));
  }
  return coded;
}

Eigen::Vector3d axis_of(const codec::CameraAxis& axis) {
  return Eigen::Vector3d(axis[0], axis[1], axis[2]).normalized();
}

constexpr auto kFull = static_cast<uint8_t>(Visibility::kFull);

/// Whether a camera has kFull, by vertex.
std::vector<bool> seen_in_full(std::span<const CameraColours> colours) {
  std::vector<bool> is_full;
  for (const CameraColours& camera : colours) {
    is_full.resize(camera.vertices.size());
    for (size_t v = 0; v < is_full.size(); ++v) {
      if (camera.vertices[v][3] == kFull) is_full[v] = true;
    }
  }
  return is_full;
}

}  // namespace

std::vector<codec::CameraView> camera_views(std::span<const CameraColours> colours,
                                            const Rig& rig) {
  const std::vector<bool> is_full = seen_in_full(colours);
  std::vector<codec::CameraView> views;
  for (const CameraColours& camera : colours) {
    const auto index = static_cast<size_t>(find_camera(rig, camera.camera));
    codec::CameraView& view = views.emplace_back();
    view.axis = coded_axis(rig[index].model.viewing_direction());
    view.vertices = camera.vertices;
    for (size_t v = 0; v < view.vertices.size(); ++v) {
      auto& vertex = view.vertices[v];
      if (vertex[3] == kFull || (vertex[3] != 0 && !is_full[v])) {
        vertex[3] = kFull;
      } else {
        vertex = {};
      }
    }
  }
  return views;
}

std::vector<Rgb8> blended_views(std::span<const Rgb8> colours,
                                std::span<const codec::CameraView> views,
                                const ViewDependence& eye) {
  std::vector<Eigen::Vector4f> sums(colours.size(), Eigen::Vector4f::Zero());
  for (const codec::CameraView& view : views) {
    const float weight = blending_weight(axis_of(view.axis), eye);
    for (size_t v = 0; v < sums.size(); ++v) {
      const auto& [r, g, b, seen] = view.vertices[v];
      if (seen != 0) sums[v] += weight * Eigen::Vector4f(r, g, b, 1);
    }
  }
  std::vector<Rgb8> blended(colours.begin(), colours.end());
  for (size_t v = 0; v < sums.size(); ++v) {
    if (sums[v][3] > 0) blended[v] = rounded_colour(sums[v].head<3>() / sums[v][3]);
  }
  return blended;
}

}  // namespace v3d::recon
