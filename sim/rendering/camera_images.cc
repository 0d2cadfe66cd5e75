#include "sim/rendering/camera_images.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>

#include "sim/performer/skeleton.h"
#include "sim/rendering/noise.h"

namespace v3d::sim {

using Eigen::Vector2d;
using Eigen::Vector3f;

/// Light of a ceiling with fluorescent tubes: strong from above, four soft directions, weak from
/// below.
float light_on(const Vector3f& normal) {
  static const std::array<Vector3f, 4> kLights = {
      Vector3f(0.5F, 0.3F, 0.8F).normalized(), Vector3f(-0.6F, 0.4F, 0.7F).normalized(),
      Vector3f(0.2F, -0.7F, 0.7F).normalized(), Vector3f(-0.5F, -0.4F, 0.5F).normalized()};
  float light = 0.52F + 0.14F * normal.z();
  for (const Vector3f& from : kLights) {
    light += 0.15F * std::max(0.0F, normal.dot(from));
  }
  return light;
}

void append(DrawList& list, const Part& part) {
  const auto first = static_cast<uint32_t>(list.vertices.size());
  std::ranges::copy(part.mesh.vertices, std::back_inserter(list.vertices));
  std::ranges::copy(vertex_normals(part.mesh), std::back_inserter(list.normals));
  std::ranges::copy(part.paint, std::back_inserter(list.paint));
  for (const Triangle& t : part.mesh.triangles) {
    list.triangles.push_back({t[0] + first, t[1] + first, t[2] + first});
    list.materials.push_back(part.material);
    list.palettes.push_back(part.palette);
  }
}

namespace {

constexpr int kNoiseSteps = 4096;  // indexed by 12 bits of a hash

/// The colour of a surface at a pixel inside one of its triangles.
Vector3f shade(const DrawList& list, std::span<const ScreenPoint> screen, uint32_t triangle, int x,
               int y, uint64_t seed) {
  const Triangle& t = list.triangles[triangle];
  const Vector3f w = weights_at(screen[t[0]], screen[t[1]], screen[t[2]], x, y);
  const auto at = [&](const std::vector<Vector3f>& values) -> Vector3f {
    return w[0] * values[t[0]] + w[1] * values[t[1]] + w[2] * values[t[2]];
  };
  return light_on(at(list.normals).normalized()) *
         paint(list.materials[triangle], at(list.paint), seed, list.palettes[triangle]);
}

/// The fraction of the light that reaches a point of the floor.
float unshadowed(const Vector2d& floor, const std::array<Vector2d, 3>& casters) {
  constexpr std::array<std::array<double, 2>, 3> kDepthAndRadius = {
      {{0.22, 0.11}, {0.22, 0.11}, {0.24, 0.30}}};
  double light = 1;
  for (size_t i = 0; i < casters.size(); ++i) {
    const auto [depth, radius] = kDepthAndRadius[i];
    light *= 1 - depth * std::exp(-(floor - casters[i]).squaredNorm() / (2 * radius * radius));
  }
  return static_cast<float>(light);
}

/// A square of floor as a fine mesh, counter-clockwise from above.
void floor_patch(const Vector2d& center, double half, std::vector<Vector3f>& vertices,
                 std::vector<Triangle>& triangles) {
  constexpr uint32_t kCells = 24;
  for (uint32_t j = 0; j <= kCells; ++j) {
    for (uint32_t i = 0; i <= kCells; ++i) {
      vertices.emplace_back(center.x() - half + 2 * half * i / kCells,
                            center.y() - half + 2 * half * j / kCells, 0);
    }
  }
  for (uint32_t j = 0; j < kCells; ++j) {
    for (uint32_t i = 0; i < kCells; ++i) {
      const uint32_t a = j * (kCells + 1) + i;
      triangles.push_back({a, a + 1, a + kCells + 2});
      triangles.push_back({a, a + kCells + 2, a + kCells + 1});
    }
  }
}

/// Quantiles of the normal distribution at (i + 0.5) / kNoiseSteps, times 256, by bisection of
/// erfc.
std::vector<int16_t> normal_quantiles(double standard_deviation) {
  std::vector<int16_t> table(kNoiseSteps);
  for (int i = 0; i < kNoiseSteps; ++i) {
    const double probability = (i + 0.5) / kNoiseSteps;
    double low = -6, high = 6;
    for (int halving = 0; halving < 40; ++halving) {
      const double middle = 0.5 * (low + high);
      (0.5 * std::erfc(-middle * M_SQRT1_2) < probability ? low : high) = middle;
    }
    table[static_cast<size_t>(i)] = static_cast<int16_t>(
        std::lround(std::clamp(256 * standard_deviation * low, -32000.0, 32000.0)));
  }
  return table;
}

uint16_t to_sample(float value) {
  return static_cast<uint16_t>(std::clamp(value, 0.0F, 1.0F) * 255 * 256);
}

std::array<Vector2d, 3> shadow_casters(double seconds, const Performer& performer) {
  const std::vector<JointDefinition> joints = joints_of(performer);
  const std::vector<Eigen::Vector3d> positions = joint_positions(seconds, performer);
  const auto place_of = [&](std::string_view main) -> Vector2d {
    const auto found = std::ranges::find(joints, main, &JointDefinition::main);
    const auto index = found == joints.end() ? 0 : found - joints.begin();
    return positions[static_cast<size_t>(index)].head<2>();
  };
  return {place_of("left_ankle"), place_of("right_ankle"), place_of("pelvis")};
}

}  // namespace

PerformersExposure expose_performers(double seconds, const RenderOptions& options) {
  PerformersExposure shot;
  shot.seed = options.seed;
  for (const Performer& performer : options.cast) {
    for (const Part& part : performer_parts(seconds, options.seed, performer)) {
      if (part.material != Material::kBlade) {
        append(shot.body, part);
      }
    }
    for (int i = 0; i < 3; ++i) {
      append(shot.blade[static_cast<size_t>(i)],
             sword_blade(seconds + (i - 1) * options.exposure_s / 3, performer));
    }
    shot.feet.push_back(shadow_casters(seconds, performer));
  }
  return shot;
}

CameraRenderer::CameraRenderer(RigCamera camera, RenderOptions options)
    : camera_(std::move(camera)),
      options_(options),
      sensor_(sensor_colour(camera_.name, options.colour_spread, options.seed)),
      noise_(normal_quantiles(options.noise)) {
  const ImageSize size = camera_.model.size();
  samples_.resize(byte_count(size, options_.format));
  const std::vector<Vector3f> room = room_image(camera_.model, options_.seed);
  for (int y = 0; y < size.height; ++y) {
    for (int x = 0; x < size.width; ++x) {
      put(x, y, room[static_cast<size_t>(y) * size.width + x]);
    }
  }
  plate_ = samples_;
}

void CameraRenderer::put(int x, int y, const Vector3f& light) {
  const Vector3f colour =
      options_.colour_spread == 0 ? light : Vector3f(sensor_.black + sensor_.matrix * light);
  const size_t pixel = static_cast<size_t>(y) * camera_.model.size().width + x;
  if (is_bayer(options_.format)) {
    samples_[pixel] = to_sample(colour[bayer_channel(options_.format, x, y)]);
  } else if (options_.format == PixelFormat::kMono8) {
    samples_[pixel] = to_sample(colour.dot(Vector3f(0.299F, 0.587F, 0.114F)));
  } else {
    for (int c = 0; c < 3; ++c) {
      samples_[3 * pixel + static_cast<size_t>(c)] = to_sample(colour[c]);
    }
  }
}

void CameraRenderer::draw_shadow(const std::array<Vector2d, 3>& feet) {
  std::vector<Vector3f> vertices;
  std::vector<Triangle> triangles;
  floor_patch(feet[2], 1.2, vertices, triangles);
  const auto screen = to_screen(camera_.model, vertices);
  depth_.clear(screen_bounds(screen, camera_.model.size()));
  depth_.draw(screen, triangles);
  const Rect area = depth_.area();
  const int channels = bytes_per_pixel(options_.format);
  for (int y = area.y0; y < area.y0 + area.height; ++y) {
    for (int x = area.x0; x < area.x0 + area.width; ++x) {
      const uint32_t hit = depth_.triangle(x, y);
      if (hit == VisibilityBuffer::kNothing) {
        continue;
      }
      const Triangle& t = triangles[hit];
      const Vector3f w = weights_at(screen[t[0]], screen[t[1]], screen[t[2]], x, y);
      const Vector3f floor = w[0] * vertices[t[0]] + w[1] * vertices[t[1]] + w[2] * vertices[t[2]];
      const float light = unshadowed(floor.head<2>().cast<double>(), feet);
      const size_t pixel = static_cast<size_t>(y) * camera_.model.size().width + x;
      for (int c = 0; c < channels; ++c) {
        uint16_t& sample = samples_[pixel * channels + c];
        sample = static_cast<uint16_t>(static_cast<float>(sample) * light);
      }
    }
  }
}

void CameraRenderer::draw_body(const PerformersExposure& shot) {
  const auto screen = to_screen(camera_.model, shot.body.vertices);
  depth_.clear(screen_bounds(screen, camera_.model.size()));
  depth_.draw(screen, shot.body.triangles);
  const Rect area = depth_.area();
  for (int y = area.y0; y < area.y0 + area.height; ++y) {
    for (int x = area.x0; x < area.x0 + area.width; ++x) {
      const uint32_t hit = depth_.triangle(x, y);
      if (hit != VisibilityBuffer::kNothing) {
        put(x, y, shade(shot.body, screen, hit, x, y, shot.seed));
      }
    }
  }
}

void CameraRenderer::draw_blade(const PerformersExposure& shot) {
  // Each instant of the exposure adds a third of the light of the blade and removes a third of the
  // background.
  const ImageSize size = camera_.model.size();
  const Rect body = depth_.area();
  const std::vector<uint16_t> behind = samples_;
  const int channels = bytes_per_pixel(options_.format);
  for (const DrawList& blade : shot.blade) {
    const auto screen = to_screen(camera_.model, blade.vertices);
    blade_depth_.clear(screen_bounds(screen, size));
    blade_depth_.draw(screen, blade.triangles);
    const Rect area = blade_depth_.area();
    for (int y = area.y0; y < area.y0 + area.height; ++y) {
      for (int x = area.x0; x < area.x0 + area.width; ++x) {
        const uint32_t hit = blade_depth_.triangle(x, y);
        if (hit == VisibilityBuffer::kNothing ||
            (body.contains(x, y) &&
             depth_.inverse_depth(x, y) > blade_depth_.inverse_depth(x, y))) {
          continue;
        }
        const size_t first = (static_cast<size_t>(y) * size.width + x) * channels;
        std::array<int, 3> before{};
        for (int c = 0; c < channels; ++c) {
          before[static_cast<size_t>(c)] = samples_[first + c];
        }
        put(x, y, shade(blade, screen, hit, x, y, shot.seed));
        for (int c = 0; c < channels; ++c) {
          const int added = (samples_[first + c] - behind[first + c]) / 3;
          samples_[first + c] = static_cast<uint16_t>(before[static_cast<size_t>(c)] + added);
        }
      }
    }
  }
}

void CameraRenderer::expose(uint64_t exposure_number, Image& image) const {
  uint64_t key = mix(options_.seed ^ mix(exposure_number));
  for (const char c : camera_.name) {
    key = mix(key ^ static_cast<uint64_t>(c));
  }
  const size_t count = samples_.size();
  for (size_t i = 0; i < count; i += 5) {
    uint64_t bits = mix(key + i);
    for (size_t j = i; j < std::min(i + 5, count); ++j, bits >>= 12) {
      const int value = samples_[j] + noise_[bits % kNoiseSteps] + 128;
      image.bytes[j] = static_cast<uint8_t>(std::clamp(value >> 8, 0, 255));
    }
  }
}

Image CameraRenderer::render(const PerformersExposure* shot, uint64_t exposure_number) {
  samples_ = plate_;
  if (shot != nullptr) {
    for (const auto& feet : shot->feet) draw_shadow(feet);
    draw_body(*shot);
    draw_blade(*shot);
  }
  Image image(camera_.model.size(), options_.format);
  expose(exposure_number, image);
  return image;
}

Image render(const RigCamera& camera, double seconds, bool with_performer, uint64_t exposure_number,
             const RenderOptions& options) {
  CameraRenderer renderer(camera, options);
  if (!with_performer) {
    return renderer.render(nullptr, exposure_number);
  }
  const PerformersExposure shot = expose_performers(seconds, options);
  return renderer.render(&shot, exposure_number);
}

Mask true_silhouette(const RigCamera& camera, double seconds, uint64_t seed, int performers) {
  DrawList list;
  for (const Performer& performer : cast_of(performers)) {
    for (const Part& part : performer_parts(seconds, seed, performer)) append(list, part);
  }
  const ImageSize size = camera.model.size();
  const auto screen = to_screen(camera.model, list.vertices);
  VisibilityBuffer depth;
  depth.clear(screen_bounds(screen, size));
  depth.draw(screen, list.triangles);
  Mask mask(size);
  const Rect area = depth.area();
  for (int y = area.y0; y < area.y0 + area.height; ++y) {
    for (int x = area.x0; x < area.x0 + area.width; ++x) {
      if (depth.triangle(x, y) != VisibilityBuffer::kNothing) {
        mask.set(x, y);
      }
    }
  }
  return mask;
}

BatchRenderer::BatchRenderer(const Rig& rig, const RenderOptions& options)
    : options_(options), cameras_(rig.size()) {
  tbb::parallel_for(size_t{0}, rig.size(), [&](size_t i) {
    cameras_[i] = std::make_unique<CameraRenderer>(rig[i], options);
  });
}

std::vector<Image> BatchRenderer::render_all(std::optional<double> seconds,
                                             uint64_t exposure_number) {
  std::optional<PerformersExposure> shot;
  if (seconds) {
    shot = expose_performers(*seconds, options_);
  }
  std::vector<Image> images(cameras_.size());
  tbb::parallel_for(size_t{0}, cameras_.size(), [&](size_t i) {
    images[i] = cameras_[i]->render(shot ? &*shot : nullptr, exposure_number);
  });
  return images;
}

std::vector<uint8_t> points_seen(const CameraModel& camera, const DrawList& list,
                                 std::span<const Eigen::Vector3f> points, double tolerance_m) {
  VisibilityBuffer depth;
  const std::vector<ScreenPoint> vertices = to_screen(camera, list.vertices);
  depth.clear(screen_bounds(vertices, camera.size()));
  depth.draw(vertices, list.triangles);
  const Rect area = depth.area();
  const std::vector<ScreenPoint> screen = to_screen(camera, points);
  std::vector<uint8_t> seen(points.size(), 0);
  for (size_t i = 0; i < points.size(); ++i) {
    if (!screen[i].seen || !camera.inside_image({screen[i].x, screen[i].y})) continue;
    const auto x = static_cast<int>(std::floor(screen[i].x + 0.5F));
    const auto y = static_cast<int>(std::floor(screen[i].y + 0.5F));
    if (!area.contains(x, y)) continue;
    const float nearest = depth.inverse_depth(x, y);
    if (nearest <= 0) continue;  // beside the drawn pixels
    seen[i] = 1 / screen[i].inverse_depth <= 1 / nearest + static_cast<float>(tolerance_m);
  }
  return seen;
}

std::vector<uint8_t> cameras_that_see(const Rig& rig, const std::vector<Part>& parts,
                                      std::span<const Eigen::Vector3f> points, double tolerance_m) {
  DrawList all;
  for (const Part& part : parts) append(all, part);
  std::vector<std::vector<uint8_t>> seen(rig.size());
  tbb::parallel_for(size_t{0}, rig.size(), [&](size_t c) {
    seen[c] = points_seen(rig[c].model, all, points, tolerance_m);
  });
  std::vector<uint8_t> count(points.size(), 0);
  for (const std::vector<uint8_t>& camera : seen) {
    for (size_t i = 0; i < count.size(); ++i) count[i] = static_cast<uint8_t>(count[i] + camera[i]);
  }
  return count;
}

}  // namespace v3d::sim
