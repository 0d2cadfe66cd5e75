#include "recon/metrics/evaluation.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>
#include <tbb/global_control.h>

#include "recon/metrics/nearest_triangle.h"
#include "recon/shapes.h"

namespace v3d::recon {
namespace {

TEST(SurfaceDistance, of_a_surface_to_itself_is_zero) {
  const Mesh ball = shapes::sphere({0, 0, 1}, 0.5F, 32);
  const SurfaceDistance d = compare_surfaces(ball, ball);
  EXPECT_LT(d.accuracy_p90_mm, 1e-3);
  EXPECT_LT(d.completeness_p90_mm, 1e-3);
  EXPECT_EQ(d.f_score_2mm, 1);
  EXPECT_LT(d.normal_error_deg, 0.1);
}

TEST(SurfaceDistance, of_concentric_spheres_is_the_difference_of_their_radii) {
  const Mesh inner = shapes::sphere({0, 0, 0}, 0.500F, 64);
  const Mesh outer = shapes::sphere({0, 0, 0}, 0.504F, 64);
  const SurfaceDistance d = compare_surfaces(outer, inner);
  EXPECT_NEAR(d.accuracy_p50_mm, 4, 0.1);
  EXPECT_NEAR(d.accuracy_p90_mm, 4, 0.2);
  EXPECT_NEAR(d.completeness_p50_mm, 4, 0.1);
  EXPECT_EQ(d.f_score_2mm, 0);
  EXPECT_EQ(d.f_score_5mm, 1);
  EXPECT_EQ(d.f_score_10mm, 1);
}

TEST(SurfaceDistance, distinguishes_excess_from_missing_surface) {
  // Two far balls of equal size; the reconstruction has only one of them.
  const Mesh one = shapes::sphere({0, 0, 0}, 0.2F, 24);
  Mesh both = one;
  shapes::append(both, shapes::sphere({1, 0, 0}, 0.2F, 24));
  const SurfaceDistance missing = compare_surfaces(one, both);
  EXPECT_LT(missing.accuracy_p90_mm, 0.01);
  EXPECT_GT(missing.completeness_p90_mm, 500);
  EXPECT_NEAR(missing.f_score_5mm, 2 * 1 * 0.5 / 1.5, 0.01);
  const SurfaceDistance extra = compare_surfaces(both, one);
  EXPECT_GT(extra.accuracy_p90_mm, 500);
  EXPECT_LT(extra.completeness_p90_mm, 0.01);
}

TEST(SurfaceDistance, reports_the_covered_part_of_the_truth) {
  const Mesh one = shapes::sphere({0, 0, 0}, 0.2F, 24);
  Mesh both = one;
  shapes::append(both, shapes::sphere({1, 0, 0}, 0.2F, 24));
  EXPECT_NEAR(compare_surfaces(one, both).covered_10mm, 0.5, 0.01);
  EXPECT_EQ(compare_surfaces(both, one).covered_2mm, 1);
}

TEST(SurfaceDistance, reports_what_the_largest_component_covers_alone) {
  const Mesh large = shapes::sphere({0, 0, 0}, 0.2F, 32);
  Mesh both = large;
  shapes::append(both, shapes::sphere({1, 0, 0}, 0.2F, 24));
  const SurfaceDistance d = compare_surfaces(both, both);
  EXPECT_EQ(d.covered_10mm, 1);
  EXPECT_NEAR(d.covered_10mm_by_largest, 0.5, 0.01);
  EXPECT_EQ(compare_surfaces(large, large).covered_10mm_by_largest, 1);
}

TEST(SurfaceChange, is_flicker_of_still_parts_and_error_of_moving_parts) {
  // One ball is still and 3 mm larger in the second surface. One moves in the truth only.
  const Mesh still = shapes::sphere({0, 0, 0}, 0.200F, 64);
  const Mesh grown = shapes::sphere({0, 0, 0}, 0.203F, 64);
  const Mesh begin = shapes::sphere({1, 0, 0}, 0.200F, 64);
  const Mesh end = shapes::sphere({1.05F, 0, 0}, 0.200F, 64);
  const auto together = [](Mesh a, const Mesh& b) {
    shapes::append(a, b);
    return a;
  };
  const Mesh truth_before = together(still, begin), truth_now = together(still, end);
  const Mesh made_now = together(grown, begin);
  const SurfaceChange change =
      compare_in_time({&truth_before, &truth_before}, {&made_now, &truth_now}).value();
  EXPECT_NEAR(change.still, 0.5, 0.05);
  EXPECT_NEAR(change.flicker_p50_mm, 3, 0.1);
  EXPECT_GT(change.moving, 0.4);
  EXPECT_GT(change.moving_p50_mm, 10);
  const SurfaceChange nothing =
      compare_in_time({&truth_before, &truth_before}, {&truth_now, &truth_now}).value();
  EXPECT_LT(nothing.flicker_p90_mm, 0.01);
  EXPECT_LT(nothing.moving_p90_mm, 0.01);
}

TEST(SurfaceChange, is_unknown_without_surfaces) {
  const Mesh ball = shapes::sphere({0, 0, 0}, 0.2F, 8), none;
  EXPECT_FALSE(compare_in_time({&none, &ball}, {&ball, &ball}));
  EXPECT_FALSE(compare_in_time({&ball, &ball}, {&none, &ball}));
  EXPECT_FALSE(compare_in_time({&ball, &none}, {&ball, &ball}));
}

TEST(SurfaceDistance, reports_the_angle_of_turned_normals) {
  Mesh flat = shapes::patch(0.5F, 0, 8);
  Mesh turned = flat;
  const double angle = 10 * std::numbers::pi / 180;
  for (Eigen::Vector3f& v : turned.vertices) {
    v = Eigen::AngleAxisf(static_cast<float>(angle), Eigen::Vector3f::UnitX()) * v;
  }
  EXPECT_NEAR(compare_surfaces(turned, flat).normal_error_deg, 10, 0.01);
  Mesh inside_out = flat;
  for (auto& t : inside_out.triangles) {
    std::swap(t[0], t[1]);
  }
  EXPECT_NEAR(compare_surfaces(inside_out, flat).normal_error_deg, 180, 0.01);
}

TEST(SurfaceDistance, does_not_depend_on_the_number_of_threads) {
  const Mesh ball = shapes::sphere({0, 0, 1}, 0.5F, 20);
  const Mesh cube = shapes::box({-0.4F, -0.4F, 0.6F}, {0.4F, 0.4F, 1.4F});
  const SurfaceDistance a = compare_surfaces(ball, cube, {.samples = 3000});
  const tbb::global_control one(tbb::global_control::max_allowed_parallelism, 1);
  const SurfaceDistance b = compare_surfaces(ball, cube, {.samples = 3000});
  EXPECT_EQ(a.accuracy_p50_mm, b.accuracy_p50_mm);
  EXPECT_EQ(a.completeness_p90_mm, b.completeness_p90_mm);
  EXPECT_EQ(a.normal_error_deg, b.normal_error_deg);
}

TEST(SurfaceDistance, without_a_surface_is_infinite_unless_both_have_none) {
  const Mesh ball = shapes::sphere({0, 0, 1}, 0.5F, 8);
  EXPECT_TRUE(std::isinf(compare_surfaces(Mesh{}, ball).completeness_p50_mm));
  EXPECT_EQ(compare_surfaces(ball, Mesh{}).f_score_10mm, 0);
  EXPECT_EQ(compare_surfaces(Mesh{}, Mesh{}).f_score_2mm, 1);
  Mesh sliver;
  sliver.vertices = {{0, 0, 0}, {1, 0, 0}};
  sliver.triangles = {{0, 1, 1}};
  EXPECT_TRUE(std::isinf(compare_surfaces(sliver, ball).accuracy_p50_mm));
}

RC_GTEST_PROP(NearestTriangle, is_the_nearest_of_all, ()) {
  Mesh mesh = shapes::sphere({0, 0, 0}, 0.4F, 6);
  shapes::append(mesh, shapes::box({0.5F, 0, 0}, {2, 0.3F, 0.1F}));
  mesh.triangles.push_back({0, 0, 0});
  mesh.triangles.push_back({0, 0, 5});
  const NearestTriangle nearest(mesh);
  const auto coordinate = [] { return *rc::gen::inRange(-3000, 3000) / 1000.0; };
  const Eigen::Vector3d p(coordinate(), coordinate(), coordinate());
  double expected = 1e9;
  for (const auto& [a, b, c] : mesh.triangles) {
    // References: brute force over all triangles, and over a fine raster of weights.
    const Eigen::Vector3d va = mesh.vertices[a].cast<double>(),
                          vb = mesh.vertices[b].cast<double>(),
                          vc = mesh.vertices[c].cast<double>();
    const Eigen::Vector3d w = nearest_weights(p, va, vb, vc);
    RC_ASSERT(w.allFinite() && w.minCoeff() >= -1e-12 && std::abs(w.sum() - 1) < 1e-12);
    const double distance = (p - w.x() * va - w.y() * vb - w.z() * vc).norm();
    for (int i = 0; i <= 10; ++i) {
      for (int j = 0; i + j <= 10; ++j) {
        const Eigen::Vector3d q = va + (i * (vb - va) + j * (vc - va)) / 10.0;
        RC_ASSERT(distance <= (p - q).norm() + 1e-12);
      }
    }
    expected = std::min(expected, distance);
  }
  RC_ASSERT(std::abs(nearest.find(p)->distance - expected) < 1e-12);
}

Image flat(ImageSize size, uint8_t value) {
  Image image(size, PixelFormat::kRGB8);
  std::fill(image.bytes.begin(), image.bytes.end(), value);
  return image;
}

Mask full(ImageSize size) {
  Mask mask(size);
  for (int y = 0; y < size.height; ++y) {
    mask.fill_row(y, 0, size.width);
  }
  return mask;
}

TEST(Psnr, follows_from_the_mean_square_difference_inside_the_mask) {
  const ImageSize size{16, 12};
  Image a = flat(size, 100), b = flat(size, 110);
  EXPECT_NEAR(psnr_db(a.view(), b.view(), full(size)), 10 * std::log10(255.0 * 255 / 100), 1e-9);
  Mask half(size);
  half.fill_row(3, 0, 16);
  for (int i = 0; i < 3 * 16; ++i) {
    b.row(3)[i] = 101;
  }
  EXPECT_NEAR(psnr_db(a.view(), b.view(), half), 20 * std::log10(255.0), 1e-9);
  EXPECT_TRUE(std::isinf(psnr_db(a.view(), a.view(), full(size))));
  EXPECT_TRUE(std::isinf(psnr_db(a.view(), b.view(), Mask(size))));
}

TEST(Ssim, is_one_for_equal_pictures_and_falls_with_noise) {
  const ImageSize size{40, 30};
  Image a(size, PixelFormat::kRGB8);
  for (size_t i = 0; i < a.bytes.size(); ++i) {
    a.bytes[i] = static_cast<uint8_t>(40 + (i / 3 % 40) * 4);
  }
  EXPECT_NEAR(ssim(a.view(), a.view(), full(size)), 1, 1e-12);
  Image some = a, much = a;
  for (size_t i = 0; i < a.bytes.size(); ++i) {
    const int noise = static_cast<int>(i * 2654435761U >> 20 & 15) - 8;
    some.bytes[i] = static_cast<uint8_t>(a.bytes[i] + noise);
    much.bytes[i] = static_cast<uint8_t>(a.bytes[i] + 4 * noise);
  }
  const double s = ssim(a.view(), some.view(), full(size));
  const double m = ssim(a.view(), much.view(), full(size));
  EXPECT_LT(s, 0.95);
  EXPECT_GT(s, m + 0.1);
  EXPECT_EQ(ssim(a.view(), much.view(), Mask(size)), 1);
}

TEST(Ssim, of_flat_pictures_is_the_term_of_their_brightness) {
  const ImageSize size{20, 20};
  const double c1 = 2.55 * 2.55;
  EXPECT_NEAR(ssim(flat(size, 100).view(), flat(size, 140).view(), full(size)),
              (2 * 100.0 * 140 + c1) / (100.0 * 100 + 140.0 * 140 + c1), 1e-6);
}

}  // namespace
}  // namespace v3d::recon
