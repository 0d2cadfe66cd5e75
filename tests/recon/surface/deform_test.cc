#include "recon/surface/deform.h"

#include <gtest/gtest.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <random>

#include "base/core/error.h"
#include "base/core/statistics.h"
#include "recon/mesh/self_intersection.h"
#include "recon/render/renderer.h"
#include "recon/shapes.h"
#include "recon/visibility/vertex_visibility.h"

namespace v3d::recon {
namespace {

constexpr ImageSize kSize{320, 240};
constexpr float kHalfEdge = 0.25F;
constexpr double kEdge = 0.010;  ///< approximate edge length, used as the voxel size

const Eigen::Vector3f kMiddle{0, 0, 1};

float angle_to_x(const Eigen::Vector3f& direction) {
  return std::acos(std::clamp(direction.x(), -1.0F, 1.0F));
}

/// Radius of a rounded cube in a direction, metres.
float die_radius(const Eigen::Vector3f& direction) {
  float sum = 0;
  for (const float c : direction) sum += square(square(square(c)));
  return kHalfEdge / std::pow(sum, 0.125F);
}

/// The same with a concavity in the face towards +x, which no silhouette shows.
float concavity_radius(const Eigen::Vector3f& direction) {
  return die_radius(direction) - 0.05F * std::exp(-square(angle_to_x(direction) / 0.35F));
}

template <class Radius>
Mesh body(int rings, const Radius& radius) {
  Mesh mesh = shapes::sphere({0, 0, 0}, 1, rings);
  for (Eigen::Vector3f& v : mesh.vertices) v = kMiddle + radius(v) * v;
  return mesh;
}

/// Speckled all over.
Mesh speckled(Mesh mesh) {
  std::mt19937 random(5);
  for (size_t v = 0; v < mesh.vertices.size(); ++v) {
    const auto grey = static_cast<uint8_t>(60 + random() % 160);
    mesh.colours.push_back({grey, grey, grey});
  }
  return mesh;
}

/// Cameras and images of a scene.
Mesh concavity_die() { return speckled(body(110, concavity_radius)); }

Mesh hull() { return body(90, die_radius); }

struct Studio {
  std::vector<CameraModel> models;
  std::vector<Frame> frames;
  std::vector<Mask> masks;
  std::vector<DeformCamera> cameras;

  /// The first `count` of them before a mesh.
  SurfaceCameras before(const Mesh& mesh, size_t count = 12) const {
    return {std::span(cameras).first(count), mesh, kEdge};
  }

  explicit Studio(const Mesh& scene) : Studio(scene, scene) {}
  /// `seen`: also what is no part of the scene.
  Studio(const Mesh& scene, const Mesh& seen) {
    for (int i = 0; i < 12; ++i) {
      const double angle = 2 * std::numbers::pi * i / 12;
      models.push_back(
          shapes::camera({2 * std::cos(angle), 2 * std::sin(angle), 1 + 0.5 * (i % 3 - 1)},
                         {0, 0, 1}, kSize, 600, {-0.1, 0.02}));
    }
    masks = draw_silhouettes(scene, models);
    for (size_t i = 0; i < models.size(); ++i) {
      frames.push_back(
          observe("cam" + std::to_string(i), {}, draw_mesh(seen, models[i]).view(), masks[i]));
    }
    for (size_t i = 0; i < models.size(); ++i) cameras.push_back({&models[i], &frames[i]});
  }
};

const Studio& studio() {
  static const Studio kStudio(concavity_die());
  return kStudio;
}

Mesh deformed(DeformOptions options) {
  options.voxel_m = kEdge;
  Mesh mesh = hull();
  Deformer(options).run(studio().before(mesh), mesh);
  return mesh;
}

/// Median signed distance to the true surface in the concavity, outward positive, metres.
double error_in_concavity(const Mesh& mesh) {
  std::vector<double> errors;
  for (const Eigen::Vector3f& v : mesh.vertices) {
    const Eigen::Vector3f out = (v - kMiddle).normalized();
    if (angle_to_x(out) > 0.3F) continue;
    errors.push_back(std::abs((v - kMiddle).norm() - concavity_radius(out)));
  }
  return upper_median(std::move(errors));
}

double min_iou(const Mesh& mesh) {
  const std::vector<Mask> drawn = draw_silhouettes(mesh, studio().models);
  double least = 1;
  for (size_t i = 0; i < drawn.size(); ++i) {
    least = std::min(least, intersection_over_union(drawn[i], studio().masks[i]));
  }
  return least;
}

TEST(Deformer, finds_a_concavity_that_no_silhouette_shows) {
  const double before = error_in_concavity(hull());
  EXPECT_GT(before, 0.030);
  EXPECT_LT(error_in_concavity(deformed({})), 0.1 * before);
}

TEST(RedundantHalvings, leave_pixels_of_a_quarter_of_a_voxel_and_never_make_finer_ones) {
  const CameraModel camera = shapes::camera({2, 0, 1}, {0, 0, 1}, kSize, 600, {});
  const Eigen::Vector3f at_2m(0, 0, 1);  // a pixel covers 3.33 mm
  EXPECT_EQ(redundant_halvings(camera, at_2m, 0.005), 0);
  EXPECT_EQ(redundant_halvings(camera, at_2m, 0.0133), 0);
  EXPECT_EQ(redundant_halvings(camera, at_2m, 0.0134), 1);
  EXPECT_EQ(redundant_halvings(camera, at_2m, 0.050), 2);
  EXPECT_EQ(redundant_halvings(camera, {4, 0, 1}, 0.050), 0) << "behind the camera";
}

TEST(Deformer, converges_by_the_papers_steps_from_a_near_start) {
  DeformOptions paper;
  paper.mode = DeformMode::kPaper;
  paper.voxel_m = kEdge;
  Mesh mesh = body(90, [](const auto& direction) {
    return 0.2F * die_radius(direction) + 0.8F * concavity_radius(direction);
  });
  const double before = error_in_concavity(mesh);
  Deformer(paper).run(studio().before(mesh), mesh);
  EXPECT_LT(error_in_concavity(mesh), 0.5 * before);
}

TEST(Deformer, finds_no_concavity_without_the_photometric_force) {
  DeformOptions blind;
  blind.photometric = 0;
  EXPECT_GT(error_in_concavity(deformed(blind)), 0.030);
}

TEST(Deformer, keeps_the_silhouettes) {
  DeformOptions careless;
  careless.silhouette = 0;
  const double kept = min_iou(deformed({}));
  EXPECT_GT(kept, min_iou(hull()) - 0.015);
  EXPECT_GT(kept, min_iou(deformed(careless)));
}

TEST(Deformer, moves_a_too_large_mesh_back_to_its_silhouettes) {
  Mesh mesh = body(90, [](const auto& direction) { return 1.04F * die_radius(direction); });
  DeformOptions options;
  options.voxel_m = kEdge;
  options.photometric = 0;
  const double before = min_iou(mesh);
  Deformer(options).run(studio().before(mesh), mesh);
  EXPECT_GT(min_iou(mesh), before + 0.5 * (1 - before));
}

/// A part a third as wide as a template window, without texture.
Mesh rod() {
  Mesh mesh = shapes::sphere({0, 0, 0}, 1, 60);
  for (Eigen::Vector3f& v : mesh.vertices) {
    v = kMiddle + Eigen::Vector3f(0.012F * v.x(), 0.012F * v.y(), 0.3F * v.z());
  }
  mesh.colours.assign(mesh.vertices.size(), {120, 120, 120});
  return mesh;
}

TEST(Deformer, does_not_compare_the_background_beside_slender_parts) {
  Mesh before_a_wall = rod();
  shapes::append(before_a_wall, speckled(shapes::sphere({0, 0, 1}, 4, 120)));
  const Studio there(rod(), before_a_wall);
  Mesh mesh = rod();
  DeformOptions options;
  options.voxel_m = kEdge;
  Deformer(options).run(there.before(mesh), mesh);
  const Mesh straight = rod();
  double sum = 0;
  for (size_t v = 0; v < mesh.vertices.size(); ++v) {
    sum += (mesh.vertices[v] - straight.vertices[v]).norm();
  }
  EXPECT_LT(sum / std::ssize(mesh.vertices), 0.0005);
}

TEST(Deformer, leaves_no_self_intersection) {
  DeformOptions rough;
  rough.internal = 0.02;
  EXPECT_TRUE(self_intersections(deformed(rough)).empty());
}

TEST(RemoveSelfIntersections, reverts_parts_that_crossed_the_other_side) {
  const Mesh ball = shapes::sphere({0, 0, 0}, 1, 30);
  Mesh pushed = ball;
  for (Eigen::Vector3f& v : pushed.vertices) {
    if (v.x() > 0.8F) v.x() -= 2.5F;
  }
  ASSERT_FALSE(self_intersections(pushed).empty());
  EXPECT_EQ(remove_self_intersections(Neighbours(ball), ball.vertices, std::nullopt, pushed), 0);
  EXPECT_TRUE(self_intersections(pushed).empty());
}

TEST(RemoveSelfIntersections,
     gives_back_as_much_as_it_must_where_the_way_back_crosses_what_is_left) {
  const Mesh ball = shapes::sphere({0, 0, 0}, 1, 60);
  Mesh moved = ball;
  for (Eigen::Vector3f& v : moved.vertices) {
    v.x() += v.x() > 0.8F ? 0.5F : 3;  // a cap that goes through the other side, like its way back
  }
  ASSERT_FALSE(self_intersections(moved).empty());
  EXPECT_EQ(remove_self_intersections(Neighbours(ball), ball.vertices, std::nullopt, moved), 0);
  EXPECT_TRUE(self_intersections(moved).empty());
}

TEST(RemoveSelfIntersections, ends_when_the_previous_surface_intersects_itself) {
  Mesh crossed = shapes::sphere({0, 0, 0}, 1, 20);
  shapes::append(crossed, shapes::sphere({0.5F, 0, 0}, 1, 20));
  const std::vector<Eigen::Vector3f> start = crossed.vertices;
  EXPECT_GT(remove_self_intersections(Neighbours(crossed), start, std::nullopt, crossed), 0);
}

TEST(Deformer, returns_the_same_surface_for_any_number_of_threads) {
  const auto with_threads = [](int threads) {
    return tbb::task_arena(threads).execute([] { return deformed({}).vertices; });
  };
  const std::vector<Eigen::Vector3f> expected = with_threads(1);
  EXPECT_EQ(with_threads(2), expected);
  EXPECT_EQ(with_threads(5), expected);
}

TEST(Deformer, is_independent_of_the_previous_frame) {
  DeformOptions options;
  options.voxel_m = kEdge;
  Deformer deformer(options);
  Mesh first = hull(), other = shapes::box({-0.2F, -0.2F, 0.8F}, {0.2F, 0.2F, 1.2F});
  deformer.run(studio().before(first), first);
  deformer.run(studio().before(other, 5), other);
  Mesh again = hull();
  deformer.run(studio().before(again), again);
  EXPECT_EQ(again.vertices, first.vertices);
}

TEST(Deformer, keeps_a_mesh_that_no_camera_sees) {
  Mesh mesh = hull();
  Deformer({}).run({}, mesh);
  EXPECT_EQ(mesh.vertices, hull().vertices);
  Mesh nothing;
  Deformer({}).run(studio().before(nothing), nothing);
  EXPECT_TRUE(nothing.vertices.empty());
}

std::string refusal(const DeformOptions& options) {
  try {
    check(options);
  } catch (const InputError& error) {
    return error.what();
  }
  return {};
}

TEST(Deformer, names_the_option_that_is_out_of_range) {
  EXPECT_EQ(refusal({}), "");
  EXPECT_EQ(refusal({.window = 4}), "deform: window: want an odd number of samples from 3 to 11");
  EXPECT_EQ(refusal({.views = 1}), "deform: views: want 2 to 8 cameras");
  EXPECT_EQ(refusal({.internal = -1}), "deform: internal: want a weight from 0 to 1");
}

// --- within the live budget

const VertexLattice kLiveLattice{Eigen::Vector3d::Zero(), kEdge / 20};

Mesh hull_on_lattice() {
  Mesh mesh = hull();
  for (Eigen::Vector3f& v : mesh.vertices) v = rounded_to(kLiveLattice, v);
  return mesh;
}

Mesh live_deformed(int passes, const Mesh& start = hull_on_lattice()) {
  Mesh mesh = start;
  LiveDeformer({.voxel_m = kEdge, .lattice = kLiveLattice})
      .run(studio().before(mesh), passes, mesh);
  return mesh;
}

TEST(LiveDeformer, finds_a_concavity_that_no_silhouette_shows_better_with_each_search) {
  const double before = error_in_concavity(hull_on_lattice());
  const double coarse = error_in_concavity(live_deformed(1));
  const double fine = error_in_concavity(live_deformed(2));
  EXPECT_LT(coarse, 0.5 * before);
  EXPECT_LT(fine, 0.25 * before);
  EXPECT_LT(fine, coarse);
}

TEST(LiveDeformer, without_passes_leaves_the_hull_as_it_is) {
  EXPECT_EQ(live_deformed(0).vertices, hull_on_lattice().vertices);
}

TEST(LiveDeformer, keeps_the_silhouettes) {
  EXPECT_GT(min_iou(live_deformed(kLivePasses)), min_iou(hull_on_lattice()) - 0.02);
}

TEST(LiveDeformer, removes_all_self_intersections_in_its_last_pass) {
  EXPECT_TRUE(self_intersections(live_deformed(kLivePasses)).empty());
}

TEST(LiveDeformer, returns_vertices_on_the_lattice_after_any_number_of_passes) {
  for (int passes = 0; passes <= kLivePasses; ++passes) {
    for (const Eigen::Vector3f& v : live_deformed(passes).vertices) {
      ASSERT_EQ(v, rounded_to(kLiveLattice, v)) << passes << " passes";
    }
  }
}

TEST(LiveDeformer, stops_between_passes_and_returns_those_that_make_the_same_mesh) {
  for (int allowed = 0; allowed < kLivePasses; ++allowed) {
    Mesh mesh = hull_on_lattice();
    int asked = 0;
    const int passes =
        LiveDeformer({.voxel_m = kEdge, .lattice = kLiveLattice})
            .run(studio().before(mesh), kLivePasses, mesh, [&] { return asked++ < allowed; });
    EXPECT_EQ(passes, allowed + 1) << "the first pass runs without a question";
    EXPECT_EQ(asked, std::min(allowed + 1, kLivePasses - 1));
    EXPECT_EQ(mesh.vertices, live_deformed(passes).vertices) << passes << " passes";
  }
}

TEST(LiveDeformer, returns_the_same_bits_for_any_threads_and_after_any_other_mesh) {
  const Mesh expected = live_deformed(kLivePasses);
  for (const int threads : {1, 3}) {
    LiveDeformer deformer({.voxel_m = kEdge, .lattice = kLiveLattice});
    tbb::task_arena(threads).execute([&] {
      Mesh other = rod(), mesh = hull_on_lattice();
      deformer.run(studio().before(other), 1, other);
      deformer.run(studio().before(mesh), kLivePasses, mesh);
      EXPECT_EQ(mesh.vertices, expected.vertices) << threads << " threads";
    });
  }
}

TEST(LiveDeformer, pulls_a_surface_without_texture_out_to_its_silhouettes) {
  constexpr float kRadius = 0.25F;
  const auto ball = [](float radius) {
    Mesh mesh = body(60, [radius](const Eigen::Vector3f&) { return radius; });
    mesh.colours.assign(mesh.vertices.size(), {150, 150, 150});
    return mesh;
  };
  const Studio plain(ball(kRadius));
  const auto median_radius = [&](int passes) {
    Mesh mesh = ball(kRadius - 0.012F);
    for (Eigen::Vector3f& v : mesh.vertices) v = rounded_to(kLiveLattice, v);
    LiveDeformer({.voxel_m = kEdge, .lattice = kLiveLattice}).run(plain.before(mesh), passes, mesh);
    std::vector<double> radii;
    for (const Eigen::Vector3f& v : mesh.vertices) radii.push_back((v - kMiddle).norm());
    return median(radii);
  };
  EXPECT_LT(median_radius(1), kRadius - 0.008) << "the coarse search ignores the silhouettes";
  EXPECT_GT(median_radius(2), kRadius - 0.004);
}

TEST(LiveDeformer, holds_the_hull_where_fewer_than_two_cameras_see_it) {
  Mesh mesh = hull_on_lattice();
  LiveDeformer({.voxel_m = kEdge, .lattice = kLiveLattice})
      .run(studio().before(mesh, 1), kLivePasses, mesh);
  const Mesh start = hull_on_lattice();
  std::vector<double> ways;
  for (size_t v = 0; v < mesh.vertices.size(); ++v) {
    ways.push_back((mesh.vertices[v] - start.vertices[v]).norm());
  }
  EXPECT_LT(percentile(ways, 0.95), 0.4 * kEdge);
  EXPECT_LT(percentile(ways, 1), kEdge) << "the outline in one camera pulls";
}

/// The vertices of a mesh that camera 0 of the studio sees, one entry each.
std::vector<uint8_t> seen_vertices(const Mesh& mesh, bool by_cells) {
  const SurfaceCameras before = studio().before(mesh, 1);
  const SurfaceCamera& camera = before.cameras[0];
  const double radius_m = 0.71 * kEdge;
  const DepthBuffer pixels = draw_depth(mesh, studio().models[0]);
  const PointDepthBuffer cells(PointArrays(occluding_points(mesh, radius_m)), vertex_centroid(mesh),
                               radius_m, studio().models[0], camera.lens(),
                               camera.silhouette().bounding_box());
  const std::vector<Eigen::Vector3f> normals = vertex_normals(mesh);
  std::vector<uint8_t> seen;
  for (size_t first = 0; first < mesh.vertices.size(); first += VertexVisibility::kCapacity) {
    const size_t count = std::min(VertexVisibility::kCapacity, mesh.vertices.size() - first);
    PointBlock positions, directions;
    positions.count = count;
    for (size_t i = 0; i < count; ++i) {
      positions.set(i, mesh.vertices[first + i]);
      directions.set(i, normals[first + i]);
    }
    VertexVisibility visibility;
    const VisibilityOptions options{.tolerance_m = 1.5F * static_cast<float>(kEdge)};
    by_cells ? test_cell_visibility(camera, cells, positions, directions, options, visibility)
             : test_visibility(camera, pixels, positions, directions, options, visibility);
    for (size_t i = 0; i < count; ++i) seen.push_back(visibility.seen[i] > 0 ? 1 : 0);
  }
  return seen;
}

/// The body behind a ball that hides part of it from camera 0, which is at (2, 0, 0.5).
Mesh die_behind_ball(float radius) {
  Mesh mesh = concavity_die();
  shapes::append(mesh, shapes::sphere({0.7F, 0, 0.85F}, radius, 40));
  return mesh;
}

/// Cells enlarge an occluder by up to two widths of a cell, here less than 20 mm.
TEST(CellVisibility, differs_from_the_depth_buffer_only_around_outlines) {
  const auto cells = seen_vertices(die_behind_ball(0.08F), true);
  const auto pixels = seen_vertices(die_behind_ball(0.08F), false);
  const auto behind_larger = seen_vertices(die_behind_ball(0.10F), false);
  const size_t body = concavity_die().vertices.size();
  size_t seen = 0, hidden = 0, wrongly_hidden = 0, wrongly_seen = 0;
  for (size_t v = 0; v < body; ++v) {
    seen += behind_larger[v];
    hidden += pixels[v] == 0;
    wrongly_hidden += behind_larger[v] && !cells[v];
    wrongly_seen += !pixels[v] && cells[v];
  }
  EXPECT_GT(seen, body / 20);
  EXPECT_LE(wrongly_hidden, seen / 100);
  EXPECT_LE(wrongly_seen, hidden / 100);
}

TEST(CellVisibility, sees_nothing_through_an_empty_buffer) {
  const Mesh mesh = hull();
  const SurfaceCameras before = studio().before(mesh, 1);
  PointBlock position, normal;
  position.count = 1;
  position.set(0, {kHalfEdge, 0, 1});
  normal.set(0, {1, 0, 0});
  VertexVisibility visibility;
  test_cell_visibility(before.cameras[0], PointDepthBuffer(), position, normal, {}, visibility);
  EXPECT_LT(visibility.seen[0], 0);
}

}  // namespace
}  // namespace v3d::recon
