#include "recon/render/rasteriser.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include "recon/random_rig.h"
#include "recon/shapes.h"

namespace v3d::recon {
namespace {

constexpr Band kImage{40, 0, 30};

ScreenVertex at_pixel(double x, double y) {
  return {static_cast<float>(x), static_cast<float>(y), 1, 1};
}

/// In and around the image; often on the centre of a pixel, where ties are decided.
ScreenVertex random_corner() {
  const bool on_centre = *rc::gen::arbitrary<bool>();
  if (on_centre) return at_pixel(uniform_int(-10, 50), uniform_int(-10, 40));
  return at_pixel(uniform(-10, 50), uniform(-10, 40));
}

/// How often each pixel of the image is drawn, row by row.
std::vector<int> drawn(const std::array<ScreenVertex, 3>& corner, Band band = kImage) {
  std::vector<int> count(size_t(kImage.width) * kImage.row_end, 0);
  for_each_span(corner, band, [&](int y, int x_begin, int x_end) {
    for (int x = x_begin; x < x_end; ++x) ++count.at(size_t(y) * kImage.width + x);
  });
  return count;
}

/// Reference, exact in integers: a ray from the centre to the left crosses an odd number of edges.
/// An edge has its upper end and not its lower one.
bool covers(const std::array<ScreenVertex, 3>& corner, int x, int y) {
  const int64_t cx = int64_t{x} * kFixedOne, cy = int64_t{y} * kFixedOne;
  int crossings = 0;
  for (int k = 0; k < 3; ++k) {
    FixedPoint p(corner[k]), q(corner[(k + 1) % 3]);
    if (q.y < p.y) std::swap(p, q);
    if (cy < p.y || cy >= q.y) continue;
    crossings += (int64_t{q.x} - p.x) * (cy - p.y) <= (cx - p.x) * (int64_t{q.y} - p.y);
  }
  return crossings % 2 == 1;
}

RC_GTEST_PROP(Spans, are_the_pixels_that_an_exact_test_of_each_centre_finds, ()) {
  const std::array<ScreenVertex, 3> corner{random_corner(), random_corner(), random_corner()};
  const std::vector<int> count = drawn(corner);
  for (int y = 0; y < kImage.row_end; ++y) {
    for (int x = 0; x < kImage.width; ++x) {
      RC_ASSERT(count[size_t(y) * kImage.width + x] == int{covers(corner, x, y)});
    }
  }
}

RC_GTEST_PROP(Spans, depend_not_on_the_order_of_the_corners, ()) {
  const ScreenVertex a = random_corner(), b = random_corner(), c = random_corner();
  RC_ASSERT(drawn({a, b, c}) == drawn({c, a, b}));
  RC_ASSERT(drawn({a, b, c}) == drawn({c, b, a}));
}

RC_GTEST_PROP(Spans, of_triangles_with_common_edges_leave_no_gap_and_draw_no_pixel_twice, ()) {
  // A triangle, and the same triangle divided at a point inside.
  const std::array<ScreenVertex, 3> whole{random_corner(), random_corner(), random_corner()};
  const double s = uniform(0.1, 0.8), t = uniform(0.1, 0.9 - s);
  const auto mix = [&](auto of) {
    return (1 - s - t) * of(whole[0]) + s * of(whole[1]) + t * of(whole[2]);
  };
  const ScreenVertex inside = at_pixel(mix([](const ScreenVertex& v) { return double{v.x}; }),
                                       mix([](const ScreenVertex& v) { return double{v.y}; }));
  // A point that the lattice moves out of a flat triangle would overlap the outside.
  const auto area = [](const FixedPoint& p, const FixedPoint& q, const FixedPoint& r) {
    return (int64_t{q.x} - p.x) * (int64_t{r.y} - p.y) -
           (int64_t{r.x} - p.x) * (int64_t{q.y} - p.y);
  };
  const FixedPoint p[3]{FixedPoint(whole[0]), FixedPoint(whole[1]), FixedPoint(whole[2])};
  const FixedPoint m(inside);
  const int64_t parts =
      std::abs(area(p[0], p[1], m)) + std::abs(area(p[1], p[2], m)) + std::abs(area(p[2], p[0], m));
  RC_PRE(parts == std::abs(area(p[0], p[1], p[2])));
  std::vector<int> sum(drawn(whole).size(), 0);
  for (int k = 0; k < 3; ++k) {
    const std::vector<int> part = drawn({whole[k], whole[(k + 1) % 3], inside});
    for (size_t i = 0; i < sum.size(); ++i) sum[i] += part[i];
  }
  RC_ASSERT(sum == drawn(whole));
}

RC_GTEST_PROP(Spans, of_bands_are_those_of_the_whole_image, ()) {
  const std::array<ScreenVertex, 3> corner{random_corner(), random_corner(), random_corner()};
  const int cut = uniform_int(0, kImage.row_end + 1);
  std::vector<int> sum = drawn(corner, {kImage.width, 0, cut});
  const std::vector<int> rest = drawn(corner, {kImage.width, cut, kImage.row_end});
  for (size_t i = 0; i < sum.size(); ++i) sum[i] += rest[i];
  RC_ASSERT(sum == drawn(corner));
}

TEST(FixedPoint, is_rounded_to_the_lattice_and_clamped) {
  EXPECT_EQ(to_fixed(1.0F), 256);
  EXPECT_EQ(to_fixed(-1.5F), -384);
  EXPECT_EQ(to_fixed(0.001F), 0);
  EXPECT_EQ(to_fixed(0.003F), 1);
  EXPECT_EQ(to_fixed(1e30F), int32_t{1} << 30);
  EXPECT_EQ(to_fixed(-1e30F), -(int32_t{1} << 30));
  EXPECT_EQ(first_pixel(256), 1);
  EXPECT_EQ(first_pixel(257), 2);
  EXPECT_EQ(first_pixel(-255), 0);
  EXPECT_EQ(first_pixel(-256), -1);
}

// --- clipping

const CameraModel kEye = shapes::camera({0, 0, 0}, {1, 0, 0}, {64, 48}, 50);

double depth_of(const Eigen::Vector3d& world) { return world.x(); }

Mesh random_triangle() {
  Mesh mesh;
  for (int k = 0; k < 3; ++k) {
    mesh.vertices.push_back(
        Eigen::Vector3d(uniform(-1, 1), uniform(-1, 1), uniform(-1, 1)).cast<float>());
  }
  mesh.triangles.push_back({0, 1, 2});
  return mesh;
}

std::vector<ScreenTriangle> clipped(const Mesh& mesh) {
  std::vector<ScreenTriangle> pieces;
  clip_to_near_plane(mesh, 0, kEye, project_vertices(mesh, kEye), pieces);
  return pieces;
}

Eigen::Vector3d point_of(const Mesh& mesh, const Eigen::Vector3f& weights) {
  Eigen::Vector3d world = Eigen::Vector3d::Zero();
  for (int k = 0; k < 3; ++k) world += double{weights[k]} * mesh.vertices[k].cast<double>();
  return world;
}

RC_GTEST_PROP(NearPlane, leaves_as_many_pieces_as_corners_are_in_front, ()) {
  const Mesh mesh = random_triangle();
  const auto in_front = std::count_if(
      mesh.vertices.begin(), mesh.vertices.end(),
      [](const Eigen::Vector3f& v) { return v.x() >= static_cast<float>(kNearPlaneMetres); });
  const size_t expected[] = {0, 1, 2, 1};
  RC_ASSERT(clipped(mesh).size() == expected[in_front]);
}

RC_GTEST_PROP(NearPlane, gives_corners_on_the_triangle_with_their_weights_and_pixels, ()) {
  const Mesh mesh = random_triangle();
  for (const ScreenTriangle& piece : clipped(mesh)) {
    for (int k = 0; k < 3; ++k) {
      RC_ASSERT(std::abs(piece.weights[k].sum() - 1) < 1e-5F);
      RC_ASSERT(piece.weights[k].minCoeff() >= 0);
      const Eigen::Vector3d world = point_of(mesh, piece.weights[k]);
      RC_ASSERT(depth_of(world) > kNearPlaneMetres - 1e-5);
      RC_ASSERT(std::abs(depth_of(world) - piece.corner[k].z) < 1e-5);
      // The error of a weight, 1e-7 of the edge, is 1e-4 pixels at the near plane.
      const Eigen::Vector2d pixel = *kEye.project(world);
      RC_ASSERT(std::abs(pixel.x() - piece.corner[k].x) < 0.02 + 1e-4 * std::abs(pixel.x()));
      RC_ASSERT(std::abs(pixel.y() - piece.corner[k].y) < 0.02 + 1e-4 * std::abs(pixel.y()));
    }
  }
}

RC_GTEST_PROP(NearPlane, cuts_away_nothing_in_front_of_it, ()) {
  const Mesh mesh = random_triangle();
  const double s = uniform(0, 1), t = uniform(0, 1 - s);
  const Eigen::Vector3f weights(Eigen::Vector3d(1 - s - t, s, t).cast<float>());
  const Eigen::Vector3d world = point_of(mesh, weights);
  RC_PRE(depth_of(world) > kNearPlaneMetres + 1e-4);
  // In the plane of the weights, a piece is a triangle, too.
  const bool found = std::ranges::any_of(clipped(mesh), [&](const ScreenTriangle& piece) {
    Eigen::Matrix3d corners;
    for (int k = 0; k < 3; ++k) corners.col(k) = piece.weights[k].cast<double>();
    const Eigen::Vector3d in_piece = corners.fullPivLu().solve(weights.cast<double>());
    return in_piece.minCoeff() > -1e-3;
  });
  RC_ASSERT(found);
}

RC_GTEST_PROP(ScreenPlane, has_the_values_of_the_corners, ()) {
  const std::array<ScreenVertex, 3> corner{random_corner(), random_corner(), random_corner()};
  const double twice_area =
      (double{corner[1].x} - corner[0].x) * (double{corner[2].y} - corner[0].y) -
      (double{corner[2].x} - corner[0].x) * (double{corner[1].y} - corner[0].y);
  RC_PRE(std::abs(twice_area) > 1e-2);
  const std::array<double, 3> values{uniform(-5, 5), uniform(-5, 5), uniform(-5, 5)};
  const ScreenPlane plane(corner, values);
  for (int k = 0; k < 3; ++k) {
    RC_ASSERT(std::abs(plane(corner[k].x, corner[k].y) - values[k]) < 1e-6);
  }
}

TEST(ScreenPlane, of_a_degenerate_triangle_has_the_value_of_its_first_corner) {
  const ScreenPlane plane({at_pixel(1, 1), at_pixel(2, 2), at_pixel(3, 3)}, {7, 8, 9});
  EXPECT_EQ(plane(20, -4), 7);
}

}  // namespace
}  // namespace v3d::recon
