#include "recon/texture/texture_atlas.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>
#include <tbb/global_control.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <map>
#include <utility>

#include "base/core/error.h"
#include "recon/metrics/evaluation.h"
#include "recon/render/renderer.h"
#include "recon/shapes.h"
#include "recon/texture/atlas_colours.h"
#include "support/message_of.h"

namespace v3d::recon {
namespace {

using shapes::camera;

float longest_edge(const Mesh& mesh, uint32_t t) {
  float longest = 0;
  for (size_t k = 0; k < 3; ++k) {
    const auto& triangle = mesh.triangles[t];
    longest = std::max(longest,
                       (mesh.vertices[triangle[k]] - mesh.vertices[triangle[(k + 1) % 3]]).norm());
  }
  return longest;
}

RC_GTEST_PROP(AtlasLayout, lies_in_the_image_with_a_gutter_around_every_chart, ()) {
  const int side = *rc::gen::inRange(128, 1024);
  const int rings = *rc::gen::inRange(6, 30);
  Mesh mesh = shapes::sphere({0, 0, 0}, 0.5F, rings);
  shapes::append(mesh, shapes::box({1, 1, 0}, {1.3F, 1.2F, 1.8F}));
  const AtlasLayout layout = lay_out_atlas(mesh, {.side = side, .gutter = 4});
  const AtlasTexels texels = atlas_texels(layout, 0);
  for (uint32_t t = 0; t < mesh.triangles.size(); ++t) {
    for (const Eigen::Vector2f& corner : layout.corners[t]) {
      RC_ASSERT(corner.minCoeff() >= 4);
      RC_ASSERT(corner.maxCoeff() <= static_cast<float>(side - 5));
    }
  }
  // Between two charts are at least twice four texels that show neither.
  const auto chart_at = [&](int x, int y) {
    const uint32_t t = texels.triangle[static_cast<size_t>(y) * side + x];
    return t == AtlasTexels::kNone ? -1 : static_cast<int>(layout.chart[t]);
  };
  for (int y = 0; y < side; ++y) {
    for (int x = 0; x + 8 < side; ++x) {
      const int chart = chart_at(x, y);
      for (int k = 1; k <= 8 && chart >= 0; ++k) {
        RC_ASSERT((chart_at(x + k, y) < 0 || chart_at(x + k, y) == chart));
      }
    }
  }
}

TEST(AtlasLayout, stretches_no_edge_beyond_its_resolution) {
  const Mesh ball = shapes::sphere({0, 0, 0}, 0.5F, 24);
  const AtlasLayout layout = lay_out_atlas(ball, {.side = 512});
  for (uint32_t t = 0; t < ball.triangles.size(); ++t) {
    const auto& [a, b, c] = layout.corners[t];
    const float longest = std::max({(a - b).norm(), (b - c).norm(), (c - a).norm()});
    const auto scale = static_cast<float>(layout.texels_per_m);
    EXPECT_LE(longest, 1.001F * scale * longest_edge(ball, t));
    EXPECT_GE(longest, 0.6F * scale * longest_edge(ball, t)) << "seen too obliquely";
  }
}

TEST(AtlasLayout, uses_the_resolution_of_a_larger_image_up_to_its_bound) {
  const Mesh ball = shapes::sphere({0, 0, 0}, 0.5F, 16);
  const double small = lay_out_atlas(ball, {.side = 256}).texels_per_m;
  const double large = lay_out_atlas(ball, {.side = 512}).texels_per_m;
  EXPECT_GT(large, 1.9 * small);
  EXPECT_GT(small, 256 / 3.2) << "the surface has 3.14 square metres; half of the image is empty";
  EXPECT_EQ(lay_out_atlas(ball, {.side = 512, .max_texels_per_m = 50}).texels_per_m, 50);
}

TEST(AtlasLayout, of_too_many_pieces_is_refused_with_what_would_be_right) {
  Mesh mesh;
  for (int i = 0; i < 400; ++i) {
    const auto at = static_cast<float>(i);
    shapes::append(mesh, shapes::box({at, 0, 0}, {at + 0.5F, 0.5F, 0.5F}));
  }
  EXPECT_THAT(test::message_of<InputError>([&] { lay_out_atlas(mesh, {.side = 128}); }),
              testing::HasSubstr("2400 charts do not fit; expected a larger atlas"));
  EXPECT_THROW(lay_out_atlas(mesh, {.side = 63}), InputError);
  EXPECT_EQ(lay_out_atlas({}, {.side = 128}).charts, 0);
}

/// The colour that a point of space has in the photographs of these tests: stripes much finer than
/// the triangles.
Eigen::Vector3f striped(const Eigen::Vector3f& p) {
  return {128 + 100 * std::sin(60 * p.x()), 128 + 100 * std::sin(50 * p.y() + 30 * p.z()), 90};
}

struct Shot {
  CameraModel model;
  Frame frame;
};

/// A photograph of a sphere of radius 0.5 with the colours of `colour`.
Shot photograph(const std::string& name, const Eigen::Vector3d& eye,
                const std::function<Eigen::Vector3f(const Eigen::Vector3f&)>& colour) {
  constexpr ImageSize kSize{400, 400};
  Shot shot{camera(eye, {0, 0, 0}, kSize, 700), {}};
  shot.frame.camera = name;
  shot.frame.sensor_size = kSize;
  shot.frame.roi = {0, 0, kSize.width, kSize.height};
  shot.frame.image = Image(kSize, PixelFormat::kRGB8);
  shot.frame.mask = Mask(kSize);
  for (int y = 0; y < kSize.height; ++y) {
    for (int x = 0; x < kSize.width; ++x) {
      const Eigen::Vector3d ray = *shot.model.ray({double(x), double(y)});
      const double along = -eye.dot(ray);
      const double inside = along * along - eye.squaredNorm() + 0.25;
      if (inside < 0) continue;
      shot.frame.mask->set(x, y);
      const Eigen::Vector3d hit = eye + (along - std::sqrt(inside)) * ray;
      const Eigen::Vector3f c = colour(hit.cast<float>());
      for (int k = 0; k < 3; ++k) {
        shot.frame.image.row(y)[3 * x + k] = static_cast<uint8_t>(std::clamp(c[k], 0.0F, 255.0F));
      }
    }
  }
  return shot;
}

std::vector<TextureCamera> borrow(const std::vector<Shot>& shots) {
  std::vector<TextureCamera> cameras;
  for (const Shot& shot : shots) cameras.push_back({&shot.model, &shot.frame});
  return cameras;
}

/// Six cameras on the axes.
std::vector<Shot> six_photographs(
    const std::function<Eigen::Vector3f(int, const Eigen::Vector3f&)>& colour) {
  std::vector<Shot> shots;
  for (int i = 0; i < 6; ++i) {
    Eigen::Vector3d eye(0.05, 0.05, 0.05);
    eye[i / 2] = i % 2 ? 2 : -2;
    shots.push_back(photograph("cam" + std::to_string(i), eye,
                               [&](const Eigen::Vector3f& p) { return colour(i, p); }));
  }
  return shots;
}

Mesh coloured_ball(std::span<const TextureCamera> cameras, int rings) {
  Mesh ball = shapes::sphere({0, 0, 0}, 0.5F, rings);
  ball.colours = colour_vertices(ball, cameras, {.demosaic = true, .by_resolution = true}).colours;
  return ball;
}

AtlasColourOptions by_resolution() {
  AtlasColourOptions options;
  options.sampling.by_resolution = true;
  return options;
}

TEST(AtlasColours, show_detail_that_is_finer_than_the_triangles) {
  const std::vector<Shot> shots =
      six_photographs([](int, const Eigen::Vector3f& p) { return striped(p); });
  const auto cameras = borrow(shots);
  const Mesh ball = coloured_ball(cameras, 24);
  AtlasLayout layout = lay_out_atlas(ball, {.side = 1024});
  AtlasColours colours = colour_atlas(ball, layout, cameras, by_resolution());
  const TextureAtlas atlas{std::move(layout), std::move(colours.image)};
  // A seventh camera that took no part.
  const Shot other = photograph("other", {1.2, 1.2, 1.0}, striped);
  Mask where(other.model.size());
  for (int y = 100; y < 300; ++y) {
    for (int x = 100; x < 300; ++x) where.set(x, y);
  }
  const auto psnr = [&](const TextureAtlas* with) {
    return psnr_db(draw_mesh(ball, other.model, {.atlas = with}).view(), other.frame.image.view(),
                   where);
  };
  EXPECT_GT(psnr(&atlas), 26);
  EXPECT_LT(psnr(nullptr), 18) << "colours of vertices show the stripes, too";
}

TEST(AtlasColours, have_no_seam_between_cameras_of_different_brightness) {
  const std::vector<Shot> shots = six_photographs([](int i, const Eigen::Vector3f&) {
    return Eigen::Vector3f::Constant(100 + 10.0F * static_cast<float>(i)).eval();
  });
  const auto cameras = borrow(shots);
  const Mesh ball = coloured_ball(cameras, 32);
  const AtlasLayout layout = lay_out_atlas(ball, {.side = 512});
  const AtlasColours colours = colour_atlas(ball, layout, cameras, by_resolution());
  const AtlasTexels texels = atlas_texels(layout, 0);
  int greatest = 0;
  for (int y = 0; y < layout.side; ++y) {
    for (int x = 0; x + 1 < layout.side; ++x) {
      const size_t at = static_cast<size_t>(y) * layout.side + x;
      const uint32_t t = texels.triangle[at], next = texels.triangle[at + 1];
      if (t == AtlasTexels::kNone || next == AtlasTexels::kNone) continue;
      greatest = std::max(greatest,
                          std::abs(colours.image.row(y)[3 * x] - colours.image.row(y)[3 * x + 3]));
    }
  }
  EXPECT_LE(greatest, 6) << "the cameras differ by up to 50";
}

/// The middle of the edge between the vertices `a` and `b` in the triangle `t`, texels.
Eigen::Vector2f middle_of_edge(const Mesh& mesh, const AtlasLayout& layout, uint32_t t, uint32_t a,
                               uint32_t b) {
  Eigen::Vector2f sum = Eigen::Vector2f::Zero();
  for (size_t k = 0; k < 3; ++k) {
    const uint32_t v = mesh.triangles[t][k];
    if (v == a || v == b) sum += layout.corners[t][k];
  }
  return sum / 2;
}

/// An edge between two charts: its vertices, and the triangles on both sides.
struct ChartSeam {
  uint32_t a = 0, b = 0, one = 0, other = 0;
};

std::vector<ChartSeam> chart_seams(const Mesh& mesh, const AtlasLayout& layout) {
  std::map<std::pair<uint32_t, uint32_t>, uint32_t> first;
  std::vector<ChartSeam> seams;
  for (uint32_t t = 0; t < mesh.triangles.size(); ++t) {
    for (size_t k = 0; k < 3; ++k) {
      const uint32_t a = mesh.triangles[t][k], b = mesh.triangles[t][(k + 1) % 3];
      const auto [at, is_new] = first.try_emplace({std::min(a, b), std::max(a, b)}, t);
      const uint32_t other = at->second;
      if (is_new || layout.chart[t] == layout.chart[other]) continue;
      if (layout.folded[t] == 0 && layout.folded[other] == 0) seams.push_back({a, b, t, other});
    }
  }
  return seams;
}

TEST(AtlasColours, are_equal_on_both_sides_of_an_edge_between_charts) {
  // Waves of many texels, and small triangles: what remains are errors of the interpolation.
  const std::vector<Shot> shots = six_photographs([](int,
                                                     const Eigen::Vector3f& p) -> Eigen::Vector3f {
    return {128 + 100 * std::sin(30 * p.x()), 128 + 100 * std::sin(20 * p.y() + 15 * p.z()), 90};
  });
  const auto cameras = borrow(shots);
  const Mesh ball = coloured_ball(cameras, 48);
  const AtlasLayout layout = lay_out_atlas(ball, {.side = 256});
  const Image image = colour_atlas(ball, layout, cameras, by_resolution()).image;
  const std::vector<ChartSeam> seams = chart_seams(ball, layout);
  ASSERT_GT(seams.size(), 100U);
  float greatest = 0;
  for (const auto& [a, b, one, other] : seams) {
    const Eigen::Vector3f here = sample_atlas(image, middle_of_edge(ball, layout, one, a, b));
    const Eigen::Vector3f there = sample_atlas(image, middle_of_edge(ball, layout, other, a, b));
    greatest = std::max(greatest, (here - there).cwiseAbs().maxCoeff());
  }
  EXPECT_LE(greatest, 8) << "the colour changes by up to 30 from texel to texel";
}

TEST(AtlasColours, that_no_camera_sees_are_those_of_the_vertices) {
  const std::vector<Shot> shots{photograph("front", {2, 0, 0}, striped)};
  const auto cameras = borrow(shots);
  Mesh ball = shapes::sphere({0, 0, 0}, 0.5F, 24);
  ball.colours.assign(ball.vertices.size(), {7, 200, 30});
  const AtlasLayout layout = lay_out_atlas(ball, {.side = 512});
  const AtlasColours colours = colour_atlas(ball, layout, cameras, by_resolution());
  EXPECT_GT(colours.unseen, colours.texels / 2);
  EXPECT_LT(colours.unseen, colours.texels * 3 / 4);
  const AtlasTexels texels = atlas_texels(layout, 0);
  int64_t behind = 0;
  for (size_t i = 0; i < texels.triangle.size(); ++i) {
    const uint32_t t = texels.triangle[i];
    if (t == AtlasTexels::kNone || ball.vertices[ball.triangles[t][0]].x() > -0.1F) continue;
    ++behind;
    ASSERT_EQ(colours.image.bytes[3 * i], 7);
    ASSERT_EQ(colours.image.bytes[3 * i + 1], 200);
  }
  EXPECT_GT(behind, 1000);
}

TEST(AtlasColours, surround_charts_with_colours_like_theirs) {
  const std::vector<Shot> shots =
      six_photographs([](int, const Eigen::Vector3f&) { return Eigen::Vector3f(180, 40, 90); });
  const auto cameras = borrow(shots);
  const Mesh ball = coloured_ball(cameras, 24);
  const AtlasLayout layout = lay_out_atlas(ball, {.side = 256});
  const AtlasColours colours = colour_atlas(ball, layout, cameras, by_resolution());
  for (size_t i = 0; i < colours.image.bytes.size(); i += 3) {
    ASSERT_NEAR(colours.image.bytes[i], 180, 2);
    ASSERT_NEAR(colours.image.bytes[i + 1], 40, 2);
  }
}

TEST(AtlasColours, depend_neither_on_threads_nor_on_the_order_of_cameras) {
  const std::vector<Shot> shots =
      six_photographs([](int, const Eigen::Vector3f& p) { return striped(p); });
  std::vector<TextureCamera> cameras = borrow(shots);
  const Mesh ball = coloured_ball(cameras, 16);
  const AtlasLayout layout = lay_out_atlas(ball, {.side = 256});
  const Image image = colour_atlas(ball, layout, cameras, by_resolution()).image;
  std::reverse(cameras.begin(), cameras.end());
  const tbb::global_control one(tbb::global_control::max_allowed_parallelism, 1);
  EXPECT_EQ(
      colour_atlas(ball, lay_out_atlas(ball, {.side = 256}), cameras, by_resolution()).image.bytes,
      image.bytes);
}

TEST(AtlasColours, of_a_mesh_without_triangles_are_black) {
  const AtlasLayout layout = lay_out_atlas({}, {.side = 64});
  const AtlasColours colours = colour_atlas({}, layout, {}, {});
  EXPECT_EQ(colours.texels, 0);
  EXPECT_EQ(colours.image.bytes.size(), 3U * 64 * 64);
}

/// An image of one texel.
AtlasColours texel(uint8_t grey, bool seen) {
  AtlasColours colours;
  colours.image = Image({1, 1}, PixelFormat::kRGB8);
  colours.image.bytes = {grey, grey, grey};
  colours.texels = 1;
  colours.seen = {static_cast<uint8_t>(seen)};
  return colours;
}

int filtered(AtlasFilter& filter, uint8_t grey, bool seen = true) {
  AtlasColours colours = texel(grey, seen);
  filter.apply(colours);
  return colours.image.bytes[0];
}

TEST(AtlasFilter, follows_noise_slowly_and_changes_at_once) {
  AtlasFilter filter;
  EXPECT_EQ(filtered(filter, 100), 100);
  EXPECT_EQ(filtered(filter, 107), 101);
  EXPECT_EQ(filtered(filter, 107), 102);
  EXPECT_EQ(filtered(filter, 200), 200);
}

TEST(AtlasFilter, keeps_the_colour_of_a_place_that_no_camera_sees_any_more) {
  AtlasFilter filter;
  EXPECT_EQ(filtered(filter, 100), 100);
  EXPECT_EQ(filtered(filter, 30, false), 100);
  EXPECT_EQ(filtered(filter, 150), 150);
}

TEST(AtlasFilter, adopts_the_colour_of_the_first_camera_at_once) {
  AtlasFilter filter;
  EXPECT_EQ(filtered(filter, 100, false), 100);
  EXPECT_EQ(filtered(filter, 110, true), 110);
}

}  // namespace
}  // namespace v3d::recon
