#include "recon/texture/texture.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>
#include <tbb/global_control.h>

#include <algorithm>
#include <array>
#include <functional>
#include <random>

#include "base/image/colour.h"
#include "recon/shapes.h"

namespace v3d::recon {
namespace {

using shapes::camera;

/// An image whose channels are given functions of the pixel, as the format's sensor sees them.
Image picture(ImageSize size, PixelFormat format, const std::function<uint8_t(int, int, int)>& f) {
  Image image(size, format);
  for (int y = 0; y < size.height; ++y) {
    for (int x = 0; x < size.width; ++x) {
      if (format == PixelFormat::kRGB8) {
        for (int c = 0; c < 3; ++c) {
          image.row(y)[3 * x + c] = f(c, x, y);
        }
      } else {
        image.row(y)[x] = f(is_bayer(format) ? bayer_channel(format, x, y) : 1, x, y);
      }
    }
  }
  return image;
}

constexpr PixelFormat kFormats[] = {PixelFormat::kBayerRG8, PixelFormat::kBayerGR8,
                                    PixelFormat::kBayerGB8, PixelFormat::kBayerBG8,
                                    PixelFormat::kRGB8};

RC_GTEST_PROP(SampleColour, follows_linear_ramps_between_the_pixels_of_every_format, ()) {
  const auto format = *rc::gen::elementOf(std::vector(std::begin(kFormats), std::end(kFormats)));
  const auto ramp = [](int c, double x, double y) { return 10 + 20 * c + (3 + c) * x + 4 * y; };
  const Image image = picture(
      {20, 16}, format, [&](int c, int x, int y) { return static_cast<uint8_t>(ramp(c, x, y)); });
  // Two pixels from the border no sample is mirrored.
  const double u = *rc::gen::inRange(200, 1700) / 100.0, v = *rc::gen::inRange(200, 1300) / 100.0;
  const auto colour = sample_colour(image.view(), u, v);
  RC_ASSERT(colour.has_value());
  for (int c = 0; c < 3; ++c) {
    RC_ASSERT(std::abs((*colour)[c] - ramp(c, u, v)) < 1e-3);
  }
}

TEST(SampleColour, returns_the_exact_colour_of_a_pixel) {
  const Image image = picture({8, 8}, PixelFormat::kBayerRG8,
                              [](int, int x, int y) { return static_cast<uint8_t>(16 * x + y); });
  EXPECT_EQ(sample_colour(image.view(), 4, 2)->x(), 16 * 4 + 2);
  EXPECT_EQ(sample_colour(image.view(), 3, 2)->y(), 16 * 3 + 2);
  EXPECT_EQ(sample_colour(image.view(), 2, 5)->y(), 16 * 2 + 5);
  EXPECT_EQ(sample_colour(image.view(), 3, 5)->z(), 16 * 3 + 5);
}

TEST(SampleColour, of_a_flat_bayer_image_is_flat_up_to_the_corners) {
  for (const PixelFormat format : kFormats) {
    for (const ImageSize size : {ImageSize{2, 2}, ImageSize{3, 5}, ImageSize{8, 6}}) {
      const Image image =
          picture(size, format, [](int c, int, int) { return static_cast<uint8_t>(50 + 60 * c); });
      for (double v = -0.5; v < size.height - 0.5; v += 0.25) {
        for (double u = -0.5; u < size.width - 0.5; u += 0.25) {
          const auto colour = sample_colour(image.view(), u, v);
          ASSERT_TRUE(colour.has_value());
          EXPECT_NEAR(colour->x(), 50, 1e-3) << name(format) << " " << u << " " << v;
          EXPECT_NEAR(colour->y(), 110, 1e-3) << name(format) << " " << u << " " << v;
          EXPECT_NEAR(colour->z(), 170, 1e-3) << name(format) << " " << u << " " << v;
        }
      }
    }
  }
}

TEST(SampleColour, finds_nothing_outside_the_image_or_in_one_too_small) {
  const Image image({8, 6}, PixelFormat::kBayerRG8);
  EXPECT_TRUE(sample_colour(image.view(), -0.5, -0.5));
  EXPECT_FALSE(sample_colour(image.view(), -0.51, 0));
  EXPECT_FALSE(sample_colour(image.view(), 7.5, 0));
  EXPECT_FALSE(sample_colour(image.view(), 0, 5.5));
  EXPECT_FALSE(sample_colour(image.view(), std::nan(""), 1));
  EXPECT_FALSE(sample_colour(Image({0, 0}, PixelFormat::kMono8).view(), 0, 0));
  EXPECT_FALSE(sample_colour(Image({1, 4}, PixelFormat::kBayerRG8).view(), 0, 0));
  EXPECT_TRUE(sample_colour(Image({1, 1}, PixelFormat::kMono8).view(), 0.3, -0.2));
}

/// A camera and the frame it took: one colour all over, no mask.
struct Shot {
  CameraModel model;
  Frame frame;
};

Shot shot(const std::string& name, const Eigen::Vector3d& eye, Rgb8 colour) {
  Shot s{camera(eye, {0, 0, 0}, {160, 120}, 120), {}};
  s.frame.camera = name;
  s.frame.sensor_size = {160, 120};
  s.frame.roi = {0, 0, 160, 120};
  s.frame.image = picture({160, 120}, PixelFormat::kRGB8, [&](int c, int, int) {
    return c == 0 ? colour.r : (c == 1 ? colour.g : colour.b);
  });
  return s;
}

std::vector<TextureCamera> borrow(const std::vector<Shot>& shots) {
  std::vector<TextureCamera> cameras;
  for (const Shot& s : shots) {
    cameras.push_back({&s.model, &s.frame});
  }
  return cameras;
}

TEST(Texture, of_a_vertex_is_the_colour_of_the_only_camera_that_it_faces) {
  const std::vector<Shot> shots{shot("left", {-3, 0, 0}, {200, 10, 20}),
                                shot("right", {3, 0, 0}, {10, 200, 30})};
  const Mesh ball = shapes::sphere({0, 0, 0}, 0.5F, 24);
  const Texture texture = colour_vertices(ball, borrow(shots), {});
  int left = 0, right = 0;
  for (size_t v = 0; v < ball.vertices.size(); ++v) {
    if (ball.vertices[v].x() < -0.2F) {
      EXPECT_EQ(texture.colours[v], (Rgb8{200, 10, 20}));
      ++left;
    } else if (ball.vertices[v].x() > 0.2F) {
      EXPECT_EQ(texture.colours[v], (Rgb8{10, 200, 30}));
      ++right;
    }
  }
  EXPECT_GT(left, 100);
  EXPECT_GT(right, 100);
}

TEST(Texture, blends_cameras_by_the_angle_between_axis_and_normal) {
  // Two cameras 45 degrees left and right of the normal weigh the same; one in front weighs
  // 1 / cos(45 deg) times as much. Equation (9).
  const double d = 3 / std::sqrt(2.0);
  const std::vector<Shot> shots{shot("a", {d, 0, d}, {200, 0, 0}),
                                shot("b", {-d, 0, d}, {0, 200, 0}),
                                shot("c", {0, 0, 3}, {0, 0, 200})};
  const Mesh plane = shapes::patch(0.2F, 0, 4);
  const Texture texture = colour_vertices(plane, borrow(shots), {});
  const double w = std::sqrt(0.5), sum = 2 * w + 1;
  for (const Rgb8& c : texture.colours) {
    EXPECT_NEAR(c.r, 200 * w / sum, 1);
    EXPECT_NEAR(c.g, 200 * w / sum, 1);
    EXPECT_NEAR(c.b, 200 / sum, 1);
  }
  EXPECT_EQ(texture.unseen, 0);
}

TEST(Texture, by_resolution_weights_cameras_by_their_squared_pixels_along_the_slant) {
  // In front at 3 m, and 45 degrees aside at 6 m: sqrt(1/2) / 2 of the pixels.
  const double d = 6 / std::sqrt(2.0);
  const std::vector<Shot> shots{shot("aside", {d, 0, d}, {0, 200, 0}),
                                shot("front", {0, 0, 3}, {200, 0, 0})};
  const Texture texture =
      colour_vertices(shapes::patch(0.02F, 0, 2), borrow(shots), {.by_resolution = true});
  for (const Rgb8& c : texture.colours) {
    EXPECT_NEAR(c.r, 200 * 8 / 9.0, 1);
    EXPECT_NEAR(c.g, 200 * 1 / 9.0, 1);
  }
}

TEST(Texture, corrects_every_camera_by_its_colour_response) {
  const std::vector<Shot> shots{shot("dark", {-3, 0, 0}, {60, 55, 110}),
                                shot("right", {3, 0, 0}, {100, 100, 200})};
  ColourResponse dark;
  dark.black = {10, 5, 10};
  dark.matrix.diagonal() << 2, 2, 2;
  std::vector<TextureCamera> cameras = borrow(shots);
  cameras[0].colour = &dark;
  const Mesh ball = shapes::sphere({0, 0, 0}, 0.5F, 24);
  for (const Rgb8& colour : colour_vertices(ball, cameras, {}).colours) {
    EXPECT_EQ(colour, (Rgb8{100, 100, 200}));
  }
}

TEST(Texture, of_demosaiced_pictures_equals_that_of_colour_cameras) {
  std::vector<Shot> raw{shot("left", {-3, 0, 0}, {0, 0, 0}), shot("right", {3, 0, 0}, {0, 0, 0})};
  std::vector<Shot> whole = raw;
  std::mt19937 random(3);
  for (size_t i = 0; i < raw.size(); ++i) {
    Image& image = raw[i].frame.image = Image({160, 120}, PixelFormat::kBayerGB8);
    for (uint8_t& byte : image.bytes) byte = static_cast<uint8_t>(random());
    whole[i].frame.image = to_rgb(image.view());
  }
  const Mesh ball = shapes::sphere({0, 0, 0}, 0.5F, 24);
  const auto colours = colour_vertices(ball, borrow(raw), {.demosaic = true}).colours;
  EXPECT_EQ(colours, colour_vertices(ball, borrow(whole), {}).colours);
  EXPECT_NE(colours, colour_vertices(ball, borrow(raw), {}).colours);
}

TEST(Texture, for_a_viewpoint_prefers_cameras_with_a_similar_direction) {
  const double d = 3 / std::sqrt(2.0);
  const std::vector<Shot> shots{shot("a", {d, 0, d}, {200, 0, 0}),
                                shot("b", {-d, 0, d}, {0, 200, 0})};
  const Mesh plane = shapes::patch(0.2F, 0, 4);
  const auto colour_for = [&](const Eigen::Vector3d& direction, double sharpness) {
    const TextureOptions options{.view = ViewDependence{direction, sharpness}};
    return colour_vertices(plane, borrow(shots), options).colours[12];
  };
  // From a: its own axis has the cosine 1, b's 0. Algorithm 2, equation (7).
  const Eigen::Vector3d from_a = Eigen::Vector3d(-1, 0, -1).normalized();
  for (const double m : {0.0, 2.0, 10.0}) {
    const double a = std::pow(3, m), b = std::pow(2, m);
    EXPECT_NEAR(colour_for(from_a, m).r, 200 * a / (a + b), 1) << m;
    EXPECT_NEAR(colour_for(from_a, m).g, 200 * b / (a + b), 1) << m;
  }
  EXPECT_EQ(colour_for({0, 0, -1}, 10), (Rgb8{100, 100, 0}));
}

TEST(Texture, takes_no_colour_through_an_occluder) {
  // A small plate hangs over a large one; the camera above sees it, the one aside sees below it.
  const std::vector<Shot> shots{shot("above", {0, 0, 3}, {250, 0, 0})};
  Mesh mesh = shapes::patch(0.5F, 0, 20);
  const size_t lower = mesh.vertices.size();
  shapes::append(mesh, shapes::patch(0.2F, 0.5F, 8));
  const Texture texture = colour_vertices(mesh, borrow(shots), {.fill_passes = 0});
  for (size_t v = 0; v < lower; ++v) {
    const float reach = mesh.vertices[v].head<2>().cwiseAbs().maxCoeff();
    if (reach < 0.2F) {
      EXPECT_EQ(texture.colours[v], kUnseenColour);
    } else if (reach > 0.3F) {
      EXPECT_EQ(texture.colours[v], (Rgb8{250, 0, 0}));
    }
  }
  EXPECT_EQ(texture.colours[lower + 40], (Rgb8{250, 0, 0}));
}

TEST(Texture, has_no_false_occlusion_on_a_visible_slanted_surface) {
  const std::vector<Shot> shots{shot("low", {3, 0, 1.2}, {250, 0, 0})};
  const Mesh plane = shapes::patch(0.5F, 0, 40);
  EXPECT_EQ(colour_vertices(plane, borrow(shots), {.depth_tolerance_m = 0.004}).unseen, 0);
}

TEST(Texture, takes_no_colour_from_outside_the_mask) {
  std::vector<Shot> shots{shot("above", {0, 0, 3}, {250, 0, 0})};
  Mask mask({160, 120});
  for (int y = 0; y < 120; ++y) {
    mask.fill_row(y, 0, 80);
  }
  shots[0].frame.mask = mask;
  const Mesh plane = shapes::patch(0.5F, 0, 20);
  const Texture texture = colour_vertices(plane, borrow(shots), {.fill_passes = 0});
  for (size_t v = 0; v < plane.vertices.size(); ++v) {
    const bool in_mask = shots[0].model.project(plane.vertices[v].cast<double>())->x() < 79.4;
    EXPECT_EQ(texture.colours[v] == kUnseenColour, !in_mask);
  }
}

TEST(Texture, takes_colour_from_the_rim_of_a_silhouette_only_without_a_better_camera) {
  std::vector<Shot> shots{shot("rim", {0, 0, 3}, {250, 0, 0}),
                          shot("whole", {0.5, 0, 3}, {0, 250, 0})};
  Mask mask({160, 120});
  for (int y = 58; y < 62; ++y) {
    mask.fill_row(y, 0, 160);  // four rows: every one is two steps from background
  }
  shots[0].frame.mask = mask;
  const Mesh plane = shapes::patch(0.02F, 0, 4);
  const Texture both = colour_vertices(plane, borrow(shots), {});
  EXPECT_EQ(std::count(both.colours.begin(), both.colours.end(), Rgb8{0, 250, 0}), 25);
  EXPECT_EQ(std::count(both.seen.begin(), both.seen.end(), 1), 25);
  shots.pop_back();
  const Texture rim = colour_vertices(plane, borrow(shots), {});
  EXPECT_EQ(std::count(rim.colours.begin(), rim.colours.end(), Rgb8{250, 0, 0}), 25);
  EXPECT_EQ(rim.unseen, 0);
  EXPECT_EQ(std::count(rim.seen.begin(), rim.seen.end(), 0), 25) << "may contain background";
}

TEST(Texture,
     a_pixel_equal_to_the_plate_gives_its_colour_only_where_no_other_camera_sees_the_vertex) {
  std::vector<Shot> shots{shot("room", {0, 0, 3}, {250, 0, 0}),
                          shot("other", {0.5, 0, 3}, {0, 250, 0})};
  Mask all({160, 120});
  for (int y = 0; y < 120; ++y) all.fill_row(y, 0, 160);
  for (Shot& s : shots) s.frame.mask = all;
  shots[0].frame.background_difference = Mask({160, 120});
  shots[1].frame.background_difference = all;
  const Mesh plane = shapes::patch(0.02F, 0, 4);
  const auto count = [](const Texture& texture, Rgb8 colour) {
    return std::count(texture.colours.begin(), texture.colours.end(), colour);
  };
  EXPECT_EQ(count(colour_vertices(plane, borrow(shots), {}), {0, 250, 0}), 25);
  shots.pop_back();
  const Texture alone = colour_vertices(plane, borrow(shots), {});
  EXPECT_EQ(count(alone, {250, 0, 0}), 25);
  EXPECT_EQ(alone.unseen, 0);
}

/// The mask is columns `begin` to `end`. The last `loose` of them equal the plates and are red, the
/// others are yellow.
Shot loose_shot(int begin, int end, int loose) {
  Shot s = shot("loose", {0, 0, 3}, {250, 0, 0});
  s.frame.mask = Mask({160, 120});
  s.frame.background_difference = Mask({160, 120});
  for (int y = 0; y < 120; ++y) {
    s.frame.mask->fill_row(y, begin, end);
    s.frame.background_difference->fill_row(y, begin, end - loose);
    for (int x = begin; x < end - loose; ++x) s.frame.image.row(y)[3 * x + 1] = 250;
  }
  return s;
}

TEST(Texture, a_vertex_with_background_like_samples_only_gets_the_colour_of_its_neighbours) {
  const std::vector<Shot> shots{loose_shot(0, 80, 6)};
  const Mesh plane = shapes::patch(0.5F, 0, 40);
  const Texture texture = colour_vertices(plane, borrow(shots), {});
  int background_like = 0;
  for (size_t v = 0; v < plane.vertices.size(); ++v) {
    const double x = shots[0].model.project(plane.vertices[v].cast<double>())->x();
    if (x > 79.4) continue;
    EXPECT_GT(texture.colours[v].g, 100) << x;  // the yellow next to the background contains red
    background_like += x > 74.5;
  }
  EXPECT_GT(background_like, 100);
}

TEST(Texture, a_vertex_with_background_like_samples_only_has_their_colour_where_none_is_better) {
  const std::vector<Shot> shots{loose_shot(74, 80, 6)};
  const Mesh plane = shapes::patch(0.5F, 0, 40);
  const Texture texture = colour_vertices(plane, borrow(shots), {});
  EXPECT_EQ(texture.unseen, std::ssize(plane.vertices));
  EXPECT_GT(std::count(texture.colours.begin(), texture.colours.end(), Rgb8{250, 0, 0}), 100);
}

TEST(Texture, spreads_colour_to_vertices_that_no_camera_sees_for_a_bounded_way) {
  const std::vector<Shot> shots{shot("above", {0, 0, 3}, {250, 60, 10})};
  const Mesh ball = shapes::sphere({0, 0, 0}, 0.5F, 24);
  const Texture all = colour_vertices(ball, borrow(shots), {});
  EXPECT_GT(all.unseen, 300);
  EXPECT_EQ(std::count(all.colours.begin(), all.colours.end(), Rgb8{250, 60, 10}),
            std::ssize(ball.vertices));
  const Texture some = colour_vertices(ball, borrow(shots), {.fill_passes = 2});
  const auto grey = std::count(some.colours.begin(), some.colours.end(), kUnseenColour);
  // The unseen half ends along a ring of 48 vertices: two passes reach at least two rings of it,
  // and not the far pole.
  EXPECT_LE(grey, some.unseen - 2 * 48);
  EXPECT_GT(grey, some.unseen - 4 * 48);
}

TEST(Texture, is_grey_without_cameras_and_empty_without_vertices) {
  const Mesh plane = shapes::patch(0.5F, 0, 2);
  const Texture grey = colour_vertices(plane, {}, {});
  EXPECT_EQ(std::count(grey.colours.begin(), grey.colours.end(), kUnseenColour), 9);
  EXPECT_EQ(grey.unseen, 9);
  EXPECT_TRUE(colour_vertices(Mesh{}, {}, {}).colours.empty());
}

TEST(Texture, is_the_same_for_any_order_of_cameras_and_number_of_threads) {
  std::vector<Shot> shots;
  for (int i = 0; i < 9; ++i) {
    shots.push_back(shot("cam" + std::to_string(i), {3 * std::cos(i), 3 * std::sin(i), 0.3 * i},
                         {uint8_t(31 * i), uint8_t(251 - 17 * i), uint8_t(90 + i)}));
  }
  const Mesh ball = shapes::sphere({0, 0, 0}, 0.5F, 40);
  auto cameras = borrow(shots);
  const Texture expected = colour_vertices(ball, cameras, {});
  for (const size_t threads : {1, 2, 7}) {
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
    std::rotate(cameras.begin(), cameras.begin() + 4, cameras.end());
    EXPECT_EQ(colour_vertices(ball, cameras, {}).colours, expected.colours);
  }
}

/// Eight colours whose mean ends in one half. Rounding depends on the last bit of the sum, and so
/// on the order of addition.
std::array<uint8_t, 8> tied_colours(std::mt19937& random) {
  std::array<uint8_t, 8> colours{};
  int sum = 0;
  for (int i = 0; i < 7; ++i) {
    colours[i] = static_cast<uint8_t>(random() % 256);
    sum += colours[i];
  }
  colours[7] = static_cast<uint8_t>(100 + (8 + 4 - (sum + 100) % 8) % 8);
  return colours;
}

TEST(Texture, adds_cameras_in_one_order_down_to_the_last_bit) {
  std::mt19937 random(5);
  const Mesh plane = shapes::patch(0.2F, 0, 1);
  std::vector<Shot> shots;
  for (int i = 0; i < 8; ++i) {
    shots.push_back(shot("cam" + std::to_string(i), {2 * std::cos(i), 2 * std::sin(i), 3}, {}));
  }
  for (int trial = 0; trial < 40; ++trial) {
    const auto tied = tied_colours(random);
    for (int i = 0; i < 8; ++i) {
      auto& bytes = shots[i].frame.image.bytes;
      std::fill(bytes.begin(), bytes.end(), tied[i]);
    }
    auto cameras = borrow(shots);
    const auto expected = colour_vertices(plane, cameras, {}).colours;
    std::rotate(cameras.begin(), cameras.begin() + 3, cameras.end());
    std::swap(cameras[1], cameras[6]);
    EXPECT_EQ(colour_vertices(plane, cameras, {}).colours, expected);
  }
}

Visibility visibility(const CameraColours& colours, size_t vertex) {
  return Visibility{colours.vertices[vertex][3]};
}

TEST(CameraColours, are_separate_for_each_camera_and_mark_invisible_vertices) {
  // By ascending name, for any order of the cameras.
  const std::vector<Shot> shots{shot("right", {3, 0, 0}, {10, 200, 30}),
                                shot("left", {-3, 0, 0}, {200, 10, 20})};
  const Mesh ball = shapes::sphere({0, 0, 0}, 0.5F, 24);
  const std::vector<CameraColours> colours = camera_colours(ball, borrow(shots), {});
  ASSERT_EQ(colours.size(), 2U);
  EXPECT_EQ(colours[0].camera, "left");
  EXPECT_EQ(colours[1].camera, "right");
  using Rgba = std::array<uint8_t, 4>;
  for (size_t v = 0; v < ball.vertices.size(); ++v) {
    const float x = ball.vertices[v].x();
    if (std::abs(x) < 0.2F) continue;
    EXPECT_EQ(colours[0].vertices[v], x < 0 ? (Rgba{200, 10, 20, 255}) : Rgba{});
    EXPECT_EQ(colours[1].vertices[v], x > 0 ? (Rgba{10, 200, 30, 255}) : Rgba{});
  }
}

TEST(CameraColours, are_corrected_like_those_of_the_texture) {
  const std::vector<Shot> shots{shot("dark", {0, 0, 3}, {60, 55, 110})};
  ColourResponse dark;
  dark.black = {10, 5, 10};
  dark.matrix.diagonal() << 2, 2, 2;
  std::vector<TextureCamera> cameras = borrow(shots);
  cameras[0].colour = &dark;
  const Mesh plane = shapes::patch(0.2F, 0, 4);
  const CameraColours colours = camera_colours(plane, cameras, {}).at(0);
  for (const auto& rgba : colours.vertices) {
    EXPECT_EQ(rgba, (std::array<uint8_t, 4>{100, 100, 200, 255}));
  }
}

TEST(CameraColours, see_nothing_behind_an_occluder) {
  const std::vector<Shot> shots{shot("above", {0, 0, 3}, {250, 0, 0})};
  Mesh mesh = shapes::patch(0.5F, 0, 20);
  const size_t lower = mesh.vertices.size();
  shapes::append(mesh, shapes::patch(0.2F, 0.5F, 8));
  const CameraColours colours = camera_colours(mesh, borrow(shots), {}).at(0);
  for (size_t v = 0; v < lower; ++v) {
    const float reach = mesh.vertices[v].head<2>().cwiseAbs().maxCoeff();
    if (reach < 0.2F) {
      EXPECT_EQ(visibility(colours, v), Visibility::kNone);
    } else if (reach > 0.3F) {
      EXPECT_EQ(visibility(colours, v), Visibility::kFull);
    }
  }
}

TEST(CameraColours, distinguish_the_rim_of_a_silhouette_from_its_inside) {
  std::vector<Shot> shots{shot("above", {0, 0, 3}, {250, 0, 0})};
  Mask mask({160, 120});
  for (int y = 0; y < 120; ++y) mask.fill_row(y, 0, 80);
  shots[0].frame.mask = mask;
  const Mesh plane = shapes::patch(0.5F, 0, 20);
  const CameraColours colours = camera_colours(plane, borrow(shots), {}).at(0);
  std::array<int, 256> count{};
  for (size_t v = 0; v < plane.vertices.size(); ++v) {
    const double x = shots[0].model.project(plane.vertices[v].cast<double>())->x();
    const Visibility wanted = x < 77.4   ? Visibility::kFull
                              : x < 79.4 ? Visibility::kRim
                                         : Visibility::kNone;
    EXPECT_EQ(visibility(colours, v), wanted) << x;
    ++count[static_cast<size_t>(wanted)];
  }
  for (const Visibility each : {Visibility::kNone, Visibility::kRim, Visibility::kFull}) {
    EXPECT_GT(count[static_cast<size_t>(each)], 0);
  }
}

TEST(CameraColours, leave_out_background_like_samples) {
  const std::vector<Shot> shots{loose_shot(0, 80, 6)};
  const Mesh plane = shapes::patch(0.5F, 0, 40);
  const CameraColours colours = camera_colours(plane, borrow(shots), {}).at(0);
  for (size_t v = 0; v < plane.vertices.size(); ++v) {
    const double x = shots[0].model.project(plane.vertices[v].cast<double>())->x();
    EXPECT_EQ(visibility(colours, v) == Visibility::kNone, x >= 73.4) << x;
  }
}

TEST(CameraColours, are_empty_for_a_camera_without_pixels_and_for_an_empty_mesh) {
  std::vector<Shot> shots{shot("blind", {0, 0, 3}, {250, 0, 0})};
  EXPECT_TRUE(camera_colours({}, borrow(shots), {}).at(0).vertices.empty());
  shots[0].frame.roi = {};
  const Mesh plane = shapes::patch(0.2F, 0, 4);
  const CameraColours colours = camera_colours(plane, borrow(shots), {}).at(0);
  ASSERT_EQ(colours.vertices.size(), plane.vertices.size());
  for (size_t v = 0; v < plane.vertices.size(); ++v)
    EXPECT_EQ(visibility(colours, v), Visibility::kNone);
}

}  // namespace
}  // namespace v3d::recon
