#include "recon/visibility/depth_buffer.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>
#include <tbb/global_control.h>

#include <random>

#include "recon/render/rasteriser.h"
#include "recon/render/renderer.h"
#include "recon/shapes.h"
#include "support/instruction_sets.h"

namespace v3d::recon {
namespace {

using shapes::camera;

const float kNothing = std::numeric_limits<float>::infinity();

TEST(DepthBufferTest, contains_a_facing_patch_at_its_distance_and_nothing_beside_it) {
  const CameraModel above = camera({0, 0, 3}, {0, 0, 0}, {64, 48}, 60);
  const DepthBuffer depth = draw_depth(shapes::patch(0.5F, 1, 1), above);
  // The patch is 1 m wide at 2 m: 30 pixels round the middle.
  int64_t covered = 0;
  for (int y = 0; y < 48; ++y) {
    for (int x = 0; x < 64; ++x) {
      const bool inside = std::abs(x - 31.5) < 15 && std::abs(y - 23.5) < 15;
      if (inside) {
        EXPECT_NEAR(depth.at(x, y), 2, 1e-5) << x << " " << y;
        ++covered;
      } else {
        EXPECT_EQ(depth.at(x, y), kNothing) << x << " " << y;
      }
    }
  }
  EXPECT_EQ(covered, 30 * 30);
}

TEST(DepthBufferTest, finds_the_depth_of_a_slanted_plane_at_every_pixel) {
  const CameraModel side = camera({0, -2, 2}, {0, 0, 0}, {80, 60}, 70);
  const DepthBuffer depth = draw_depth(shapes::patch(0.8F, 0, 3), side);
  int checked = 0;
  for (int y = 0; y < 60; ++y) {
    for (int x = 0; x < 80; ++x) {
      if (depth.at(x, y) == kNothing) {
        continue;
      }
      const Eigen::Vector3d ray = *side.ray({double(x), double(y)});
      const double along = -side.center().z() / ray.z();
      EXPECT_NEAR(depth.at(x, y), along * ray.dot(side.viewing_direction()), 1e-5);
      ++checked;
    }
  }
  EXPECT_GT(checked, 1000);
}

TEST(DepthBufferTest, keeps_the_nearer_of_two_surfaces_in_any_order) {
  const CameraModel above = camera({0, 0, 3}, {0, 0, 0}, {64, 48}, 60);
  Mesh near_first = shapes::patch(0.2F, 1, 2), far_first = shapes::patch(0.5F, 0, 2);
  shapes::append(near_first, shapes::patch(0.5F, 0, 2));
  shapes::append(far_first, shapes::patch(0.2F, 1, 2));
  const DepthBuffer a = draw_depth(near_first, above), b = draw_depth(far_first, above);
  EXPECT_EQ(a.z, b.z);
  EXPECT_NEAR(a.at(32, 24), 2, 1e-5);
  EXPECT_NEAR(a.at(24, 24), 3, 1e-5);
}

TEST(DepthBufferTest, handles_a_mesh_around_the_camera) {
  // The camera stands inside the box, off its middle: it sees the far walls and no near ones.
  const CameraModel inside = camera({0.5, 0.2, 0.1}, {5, 0.2, 0.1}, {32, 24}, 30);
  const DepthBuffer depth = draw_depth(shapes::box({-1, -1, -1}, {2, 1, 1}), inside);
  for (const float z : depth.z) {
    EXPECT_GT(z, 0.04F);
    EXPECT_LE(z, 1.5F + 1e-4F);
  }
  EXPECT_NEAR(depth.at(16, 12), 1.5, 1e-4);
}

TEST(DepthBufferTest, draws_the_part_of_a_triangle_beyond_the_near_plane) {
  // A floor that runs from behind the camera to far ahead of it.
  Mesh floor = shapes::patch(10, 0, 1);
  const CameraModel eye = camera({0, 0, 1}, {0, 5, 1}, {64, 64}, 32);
  const DepthBuffer depth = draw_depth(floor, eye);
  for (int y = 40; y < 64; ++y) {
    // Looking level, row y sees the floor at z = f * height / (y - cy).
    EXPECT_NEAR(depth.at(20, y), 32.0 / (y - 31.5), 1e-4) << y;
  }
  EXPECT_EQ(depth.at(32, 20), kNothing);
}

TEST(DepthBufferTest, has_the_same_depths_with_front_faces_only_of_a_closed_surface) {
  // Concave, with parts before and behind each other.
  Mesh mesh = shapes::sphere({0, 0, 0}, 0.5F, 60);
  for (Eigen::Vector3f& v : mesh.vertices)
    v *= 1 + 0.3F * std::sin(25 * v.x()) * std::cos(19 * v.y());
  shapes::append(mesh, shapes::box({-1, -0.9F, -0.2F}, {1, -0.7F, -0.1F}));
  for (const Eigen::Vector3d& from : {Eigen::Vector3d(0, -3, 1), {2.5, 0.5, 0.2}, {0.3, 0.2, 2}}) {
    const CameraModel eye = camera(from, {0, 0, 0}, {150, 110}, 120, {-0.1, 0.02});
    const DepthBuffer fronts = draw_depth(mesh, eye, Faces::kFront), all = draw_depth(mesh, eye);
    for (size_t i = 0; i < all.z.size(); ++i) {
      ASSERT_EQ(std::isfinite(fronts.z[i]), std::isfinite(all.z[i]));
      if (!std::isfinite(all.z[i])) continue;
      // At an outline, a back face may be as near, up to the rounding of its plane.
      EXPECT_NEAR(fronts.z[i], all.z[i], 3e-4);
    }
  }
}

TEST(DepthBufferTest, draws_no_back_faces_on_request) {
  const CameraModel above = camera({0, 0, 3}, {0, 0, 0}, {64, 48}, 60);
  Mesh patch = shapes::patch(0.5F, 1, 3);
  EXPECT_EQ(draw_depth(patch, above, Faces::kFront).z, draw_depth(patch, above).z);
  for (auto& [a, b, c] : patch.triangles) std::swap(b, c);
  for (const float z : draw_depth(patch, above, Faces::kFront).z) EXPECT_EQ(z, kNothing);
}

TEST(DepthBufferTest, ignores_triangles_behind_the_camera_or_outside_the_image) {
  const CameraModel eye = camera({0, 0, 1}, {0, 5, 1}, {64, 64}, 64);
  Mesh mesh = shapes::sphere({0, -3, 1}, 0.5F, 8);
  shapes::append(mesh, shapes::sphere({30, 5, 1}, 0.5F, 8));
  shapes::append(mesh, shapes::sphere({0, 5, -30}, 0.5F, 8));
  for (const float z : draw_depth(mesh, eye).z) {
    EXPECT_EQ(z, kNothing);
  }
}

TEST(DepthBufferTest, accepts_triangles_without_area_and_no_triangles) {
  const CameraModel above = camera({0, 0, 3}, {0, 0, 0}, {16, 16}, 16);
  Mesh mesh;
  mesh.vertices = {{0, 0, 0}, {0.1F, 0, 0}, {0.2F, 0, 0}};
  mesh.triangles = {{0, 1, 2}, {0, 0, 0}, {0, 1, 1}};
  for (const float z : draw_depth(mesh, above).z) {
    EXPECT_EQ(z, kNothing);
  }
  EXPECT_EQ(draw_depth(Mesh{}, above).at(3, 3), kNothing);
}

/// Triangles of all sizes, from slivers to some that fill the image and reach behind the camera.
Mesh soup(uint32_t seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<float> coordinate(-1.5F, 1.5F), unit(-1, 1), part(0, 1);
  Mesh mesh;
  for (uint32_t t = 0; t < 300; ++t) {
    const Eigen::Vector3f middle(coordinate(random), coordinate(random), coordinate(random));
    const float size = 2 * std::pow(part(random), 6.0F);
    for (int k = 0; k < 3; ++k) {
      mesh.vertices.emplace_back(middle +
                                 size * Eigen::Vector3f(unit(random), unit(random), unit(random)));
    }
    mesh.triangles.push_back({3 * t, 3 * t + 1, 3 * t + 2});
  }
  return mesh;
}

const CameraModel kAmidTheSoup = camera({0, -1.2, 0.2}, {0, 1, 0}, {150, 110}, 90, {-0.1, 0.02});

RC_GTEST_PROP(DepthBufferTest, covers_the_pixels_that_spans_say_for_triangles_of_every_size, ()) {
  Mesh mesh = soup(*rc::gen::arbitrary<uint32_t>());
  mesh.triangles.resize(*rc::gen::inRange<size_t>(1, 40));
  const Mask mask = draw_silhouette(mesh, kAmidTheSoup);
  const DepthBuffer depth = draw_depth(mesh, kAmidTheSoup);
  for (int y = 0; y < depth.size.height; ++y) {
    for (int x = 0; x < depth.size.width; ++x) {
      RC_ASSERT(mask.get(x, y) == std::isfinite(depth.at(x, y)));
    }
  }
}

TEST(DepthBufferTest, draws_many_cameras_at_once_as_it_draws_one_with_any_number_of_threads) {
  const Mesh mesh = soup(1);
  std::vector<CameraModel> ring;
  for (int i = 0; i < 7; ++i) {
    ring.push_back(camera({2 * std::cos(i), 2 * std::sin(i), 0.5}, {0, 0, 0}, {64, 48}, 60));
  }
  std::vector<DepthBuffer> depths(9, draw_depth(mesh, kAmidTheSoup));  // from another use
  for (const size_t threads : {1, 2, 5}) {
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
    draw_depths(mesh, ring, depths);
    ASSERT_EQ(depths.size(), ring.size());
    for (size_t i = 0; i < ring.size(); ++i) {
      EXPECT_EQ(depths[i].z, draw_depth(mesh, ring[i]).z);
    }
  }
}

TEST(DepthBufferTest, returns_the_same_bits_on_every_instruction_set_and_for_every_order) {
  for (const Distortion& lens : {Distortion{}, Distortion{-0.2, 0.05, 0.001, -0.002},
                                 Distortion{-0.2, 0.05, 0.001, -0.002, 0.01, 0.02, 0, 0, 0.003}}) {
    Mesh mesh = soup(2);
    shapes::append(mesh, shapes::sphere({0, 0.5F, 0}, 0.4F, 40));
    const CameraModel eye = camera({0, -1.2, 0.2}, {0, 1, 0}, {150, 110}, 90, lens);
    const DepthBuffer best = draw_depth(mesh, eye);
    on_every_instruction_set([&] {
      std::reverse(mesh.triangles.begin(), mesh.triangles.end());
      const DepthBuffer found = draw_depth(mesh, eye);
      EXPECT_EQ(found.z, best.z);
    });
  }
}

TEST(ProjectVertices, returns_the_pixels_of_the_camera_model_and_marks_invisible_points) {
  for (const Distortion& lens : {Distortion{}, Distortion{-0.2, 0.05, 0.001, -0.002}}) {
    const CameraModel eye = camera({0, -1.2, 0.2}, {0, 1, 0}, {150, 110}, 90, lens);
    const Mesh mesh = soup(3);
    const auto screen = project_vertices(mesh, eye);
    ASSERT_EQ(screen.size(), mesh.vertices.size());
    int seen = 0;
    for (size_t v = 0; v < screen.size(); ++v) {
      const Eigen::Vector3d in_camera = eye.cam_from_world() * mesh.vertices[v].cast<double>();
      EXPECT_NEAR(screen[v].z, in_camera.z(), 1e-5);
      const auto pixel = eye.project(mesh.vertices[v].cast<double>());
      if (in_camera.z() < 0.2) {
        EXPECT_TRUE(in_camera.z() > kNearPlaneMetres - 1e-5 || !screen[v].on_screen());
      } else if (pixel && eye.inside_image(*pixel)) {
        ASSERT_TRUE(screen[v].on_screen());
        EXPECT_NEAR(screen[v].x, pixel->x(), 0.02);
        EXPECT_NEAR(screen[v].y, pixel->y(), 0.02);
        EXPECT_EQ(screen[v].inverse_z, 1 / screen[v].z);
        ++seen;
      }
    }
    EXPECT_GT(seen, 200);
  }
}

/// Pixel centre inside the triangle by the signs of three cross products; empty on the border.
std::optional<bool> covers(const std::array<ScreenVertex, 3>& t, int x, int y) {
  int positive = 0, negative = 0;
  for (int k = 0; k < 3; ++k) {
    const ScreenVertex &p = t[k], &q = t[(k + 1) % 3];
    const double side =
        (double{q.x} - p.x) * (y - double{p.y}) - (double{q.y} - p.y) * (x - double{p.x});
    if (std::abs(side) < 1e-6) {
      return std::nullopt;
    }
    ++(side > 0 ? positive : negative);
  }
  return positive == 3 || negative == 3;
}

RC_GTEST_PROP(Spans, cover_the_pixel_centres_inside_any_triangle, ()) {
  constexpr ImageSize kSize{24, 18};
  std::array<ScreenVertex, 3> corner;
  for (ScreenVertex& v : corner) {
    v.x = static_cast<float>(*rc::gen::inRange(-25 * kFixedOne, 45 * kFixedOne)) / kFixedOne;
    v.y = static_cast<float>(*rc::gen::inRange(-25 * kFixedOne, 40 * kFixedOne)) / kFixedOne;
  }
  std::vector<int> count(static_cast<size_t>(kSize.pixels()), 0);
  for_each_span(corner, Band{kSize.width, 0, kSize.height}, [&](int y, int begin, int end) {
    RC_ASSERT(y >= 0 && y < kSize.height && begin >= 0 && end <= kSize.width);
    for (int x = begin; x < end; ++x) {
      ++count[y * kSize.width + x];
    }
  });
  for (int y = 0; y < kSize.height; ++y) {
    for (int x = 0; x < kSize.width; ++x) {
      if (const auto inside = covers(corner, x, y)) {
        RC_ASSERT(count[y * kSize.width + x] == (*inside ? 1 : 0));
      }
    }
  }
}

RC_GTEST_PROP(Spans, of_a_fan_of_triangles_draw_every_pixel_once, ()) {
  // Four triangles round a point tile a square: no gap, no pixel twice, corners on pixel centres.
  const std::array<std::array<float, 2>, 4> square{{{2, 2}, {14, 2}, {14, 14}, {2, 14}}};
  ScreenVertex middle;
  middle.x = static_cast<float>(*rc::gen::inRange(8 * 3, 8 * 13)) / 8;
  middle.y = static_cast<float>(*rc::gen::inRange(8 * 3, 8 * 13)) / 8;
  std::array<std::array<int, 16>, 16> count{};
  for (int k = 0; k < 4; ++k) {
    ScreenVertex a, b;
    a.x = square[k][0], a.y = square[k][1];
    b.x = square[(k + 1) % 4][0], b.y = square[(k + 1) % 4][1];
    for_each_span({a, b, middle}, Band{16, 0, 16}, [&](int y, int begin, int end) {
      for (int x = begin; x < end; ++x) {
        ++count[y][x];
      }
    });
  }
  for (int y = 0; y < 16; ++y) {
    for (int x = 0; x < 16; ++x) {
      RC_ASSERT(count[y][x] == (x >= 2 && x < 14 && y >= 2 && y < 14 ? 1 : 0));
    }
  }
}

RC_GTEST_PROP(DrawTriangles, of_a_fan_draw_every_pixel_once, ()) {
  // The same in registers: small triangles, and larger ones that are drawn row by row.
  const int size = *rc::gen::elementOf(std::vector{6, 12, 60});
  const auto side = static_cast<float>(size);
  std::vector<ScreenVertex> corners(5);
  for (int k = 0; k < 4; ++k) {
    corners[k].x = k == 1 || k == 2 ? 2 + side : 2;
    corners[k].y = k >= 2 ? 2 + side : 2;
  }
  corners[4].x = static_cast<float>(*rc::gen::inRange(8 * 3, 8 * (1 + size))) / 8;
  corners[4].y = static_cast<float>(*rc::gen::inRange(8 * 3, 8 * (1 + size))) / 8;
  for (ScreenVertex& v : corners) {
    v.inverse_z = 1;
  }
  const ImageSize image{size + 4, size + 4};
  std::vector<float> count(static_cast<size_t>(image.pixels()), 0.0F);
  for (uint32_t k = 0; k < 4; ++k) {
    std::vector<float> alone(count.size(), 0.0F);
    const std::vector<std::array<uint32_t, 3>> triangle{{k, (k + 1) % 4, 4}};
    std::vector<uint32_t> cut;
    draw_triangles(corners, triangle, image, Faces::kBoth, alone.data(), cut);
    RC_ASSERT(cut.empty());
    std::transform(count.begin(), count.end(), alone.begin(), count.begin(), std::plus());
  }
  for (int y = 0; y < image.height; ++y) {
    for (int x = 0; x < image.width; ++x) {
      const bool inside = x >= 2 && x < 2 + size && y >= 2 && y < 2 + size;
      RC_ASSERT(count[static_cast<size_t>(y) * image.width + x] == (inside ? 1 : 0));
    }
  }
}

TEST(Silhouette, of_a_sphere_is_the_expected_disc) {
  const CameraModel eye = camera({0, -3, 0}, {0, 0, 0}, {200, 160}, 150);
  const Mask mask = draw_silhouette(shapes::sphere({0, 0, 0}, 0.8F, 64), eye);
  Mask disc(mask.size());
  const double radius = 150 * std::tan(std::asin(0.8 / 3));
  for (int y = 0; y < 160; ++y) {
    for (int x = 0; x < 200; ++x) {
      disc.set(x, y, std::hypot(x - 99.5, y - 79.5) <= radius);
    }
  }
  EXPECT_GT(intersection_over_union(mask, disc), 0.99);
}

TEST(Silhouette, is_what_the_depth_buffer_covers) {
  const CameraModel eye = camera({1, -2, 1}, {0, 0, 0}, {120, 90}, 100, {-0.25, 0.1, 0.001, 0.002});
  Mesh mesh = shapes::box({-0.5F, -0.5F, -0.5F}, {0.5F, 0.5F, 0.5F});
  shapes::append(mesh, shapes::sphere({0.8F, 0, 0.8F}, 0.4F, 12));  // cut by the border
  const Mask mask = draw_silhouette(mesh, eye);
  const DepthBuffer depth = draw_depth(mesh, eye);
  for (int y = 0; y < 90; ++y) {
    for (int x = 0; x < 120; ++x) {
      EXPECT_EQ(mask.get(x, y), depth.at(x, y) != kNothing);
    }
  }
  EXPECT_GT(mask.count(), 1000);
  EXPECT_EQ(draw_silhouettes(mesh, std::vector{eye, eye})[1], mask);
}

}  // namespace
}  // namespace v3d::recon
