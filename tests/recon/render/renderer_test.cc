#include "recon/render/renderer.h"

#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include "base/geometry/rigid_transform.h"
#include "recon/shapes.h"

namespace v3d::recon {
namespace {

using shapes::camera;

Rgb8 pixel(const Image& image, int x, int y) {
  const uint8_t* p = image.row(y) + 3 * x;
  return {p[0], p[1], p[2]};
}

TEST(Renderer, shows_vertex_colours_as_they_are_over_the_background) {
  Mesh plane = shapes::patch(0.5F, 0, 2);
  plane.colours.assign(plane.vertices.size(), {200, 100, 50});
  const Image image = draw_mesh(plane, camera({0, 0, 2}, {0, 0, 0}, {64, 48}, 60),
                                {.top = {10, 20, 30}, .bottom = {10, 20, 30}});
  EXPECT_EQ(pixel(image, 32, 24), (Rgb8{200, 100, 50}));
  EXPECT_EQ(pixel(image, 2, 2), (Rgb8{10, 20, 30}));
}

TEST(Renderer, blends_edges_by_the_covered_part_of_the_pixel) {
  // The patch ends in the middle of a column: half of its samples are covered.
  Mesh plane = shapes::patch(1, 0, 1);
  plane.colours.assign(plane.vertices.size(), {200, 200, 200});
  Eigen::Matrix3d matrix;
  matrix << 10, 0, 10, 0, 10, 16, 0, 0, 1;
  const CameraModel above({32, 32}, matrix, {}, look_at({0, 0, 1}, {0, 0, 0}));
  const Image image = draw_mesh(plane, above, {.top = {}, .bottom = {}});
  EXPECT_EQ(pixel(image, 19, 16), (Rgb8{200, 200, 200}));
  EXPECT_EQ(pixel(image, 20, 16), (Rgb8{100, 100, 100}));
  EXPECT_EQ(pixel(image, 21, 16), (Rgb8{0, 0, 0}));
}

TEST(Renderer, interpolates_colour_along_the_surface_not_along_the_picture) {
  // A strip runs away from the eye; its colour is its distance. Halfway along the strip the colour
  // is the mean, which is not halfway down the picture.
  Mesh strip;
  strip.vertices = {{-0.5F, 1, 0}, {0.5F, 1, 0}, {-0.5F, 9, 0}, {0.5F, 9, 0}};
  strip.triangles = {{0, 1, 2}, {1, 3, 2}};
  strip.colours = {{0, 0, 0}, {0, 0, 0}, {240, 240, 240}, {240, 240, 240}};
  const CameraModel eye = camera({0, 0, 1}, {0, 3, 0}, {200, 200}, 150);
  const Image image = draw_mesh(strip, eye, {.top = {}, .bottom = {}});
  for (double y = 2; y < 8.5; y += 1) {
    const Eigen::Vector2d at = *eye.project({0, y, 0});
    EXPECT_NEAR(pixel(image, int(at.x() + 0.5), int(at.y() + 0.5)).r, 240 * (y - 1) / 8,
                1 + 30 * 0.5 * y * y / 150)
        << y;  // half a pixel in the picture is y^2 / (2 f) on the floor
  }
}

TEST(Renderer, lights_a_mesh_without_colour_from_the_camera) {
  const Mesh ball = shapes::sphere({0, 0, 0}, 0.5F, 32);
  const Image image = draw_mesh(ball, camera({0, -2, 0}, {0, 0, 0}, {100, 100}, 150), {});
  EXPECT_GT(pixel(image, 50, 50).r, 195);
  EXPECT_LT(pixel(image, 50 + 36, 50).r, 120);
}

TEST(Renderer, draws_the_silhouette) {
  Mesh ball = shapes::sphere({0.3F, 0, 0}, 0.5F, 16);
  ball.colours.assign(ball.vertices.size(), {255, 255, 255});
  const CameraModel eye = camera({0, -2, 0.4}, {0, 0, 0}, {90, 70}, 90, {-0.2, 0.05});
  const Image image = draw_mesh(ball, eye, {.top = {}, .bottom = {}});
  Mask drawn(eye.size());
  for (int y = 0; y < 70; ++y) {
    for (int x = 0; x < 90; ++x) {
      drawn.set(x, y, pixel(image, x, y).r > 127);
    }
  }
  EXPECT_GT(intersection_over_union(drawn, draw_silhouette(ball, eye)), 0.97);
}

TEST(Renderer, returns_the_same_picture_for_any_number_of_threads) {
  const Mesh ball = shapes::sphere({0, 0, 0.5F}, 0.5F, 16);
  const CameraModel eye = camera({1, -2, 1}, {0, 0, 0.4}, {120, 90}, 90);
  const DrawOptions options{.floor = FloorOptions{}};
  const Image many = draw_mesh(ball, eye, options);
  const tbb::global_control one(tbb::global_control::max_allowed_parallelism, 1);
  EXPECT_EQ(draw_mesh(ball, eye, options).bytes, many.bytes);
}

TEST(Renderer, puts_a_shadow_on_the_floor_under_the_mesh) {
  const Mesh cube = shapes::box({-0.2F, -0.2F, 0.3F}, {0.2F, 0.2F, 0.7F});
  const CameraModel eye = camera({0, -3, 1.5}, {0, 0, 0}, {120, 90}, 110);
  DrawOptions options{.floor = FloorOptions{.shadow_depth = 0}};
  const Image light = draw_mesh(cube, eye, options);
  options.floor->shadow_depth = 0.8;
  const Image dark = draw_mesh(cube, eye, options);
  const Eigen::Vector2d below = *eye.project({0.05, -0.1, 0}), beside = *eye.project({1, 0.1, 0});
  const auto at = [](const Image& image, const Eigen::Vector2d& p) {
    return pixel(image, int(p.x() + 0.5), int(p.y() + 0.5)).r;
  };
  EXPECT_LT(at(dark, below), 0.8 * at(light, below));
  EXPECT_EQ(at(dark, beside), at(light, beside));
}

TEST(Renderer, draws_nothing_but_background_without_a_mesh) {
  const Image image =
      draw_mesh({}, camera({0, -2, 1}, {0, 0, 0}, {32, 24}, 30), {.floor = FloorOptions{}});
  EXPECT_EQ(image.size, (ImageSize{32, 24}));
}

TEST(Turntable, cameras_see_all_of_the_box_from_all_sides) {
  for (const Eigen::Vector3d& size : {Eigen::Vector3d(1, 0.6, 1.8), Eigen::Vector3d(3, 3, 0.2)}) {
    const Box box{Eigen::Vector3d(1, 2, 0), Eigen::Vector3d(1, 2, 0) + size};
    const auto cameras = turntable_cameras(box, 8, {320, 240});
    ASSERT_EQ(cameras.size(), 8U);
    EXPECT_LT(cameras[0].center().y(), box.min.y());
    for (const CameraModel& c : cameras) {
      for (int i = 0; i < 8; ++i) {
        const Eigen::Vector3d corner(i & 1 ? box.max.x() : box.min.x(),
                                     i & 2 ? box.max.y() : box.min.y(),
                                     i & 4 ? box.max.z() : box.min.z());
        EXPECT_TRUE(c.inside_image(*c.project(corner)));
      }
    }
  }
}

TEST(ContactSheet, shows_every_view_at_its_position) {
  std::vector<Image> views;
  for (int i = 0; i < 5; ++i) {
    views.emplace_back(ImageSize{20, 30}, PixelFormat::kRGB8);
    std::fill(views.back().bytes.begin(), views.back().bytes.end(), uint8_t(100 + i));
  }
  const Image sheet = contact_sheet(views, 3);
  EXPECT_EQ(sheet.size, (ImageSize{3 * 26 + 6, 2 * 36 + 6}));
  for (int i = 0; i < 5; ++i) {
    EXPECT_EQ(pixel(sheet, 6 + 26 * (i % 3), 6 + 36 * (i / 3)).r, 100 + i);
    EXPECT_EQ(pixel(sheet, 25 + 26 * (i % 3), 35 + 36 * (i / 3)).r, 100 + i);
  }
  EXPECT_LT(pixel(sheet, 6 + 26 * 2, 6 + 36).r, 50);  // the sixth place is empty
  EXPECT_EQ(contact_sheet(views).size.height, 2 * 36 + 6);
}

}  // namespace
}  // namespace v3d::recon
