#include "recon/surface/temporal_smoothing.h"

#include <gtest/gtest.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <random>

#include "base/core/statistics.h"
#include "recon/mesh/self_intersection.h"
#include "recon/metrics/evaluation.h"
#include "recon/render/renderer.h"
#include "recon/shapes.h"

namespace v3d::recon {
namespace {

constexpr ImageSize kSize{320, 240};
constexpr float kRadius = 0.25F;
const TemporalSmoothingOptions kOptions{.voxel_m = 0.010};
const Eigen::Vector3f kMiddle{0, 0, 1};

const std::vector<CameraModel>& models() {
  static const std::vector<CameraModel> kModels = [] {
    std::vector<CameraModel> models;
    for (int i = 0; i < 8; ++i) {
      const double angle = 2 * std::numbers::pi * i / 8;
      models.push_back(
          shapes::camera({2 * std::cos(angle), 2 * std::sin(angle), 1 + 0.8 * (i % 3 - 1)},
                         {0, 0, 1}, kSize, 600, {-0.1, 0.02}));
    }
    return models;
  }();
  return kModels;
}

/// Images of a ball: speckled with a seed, plain without one.
Mesh ball(const Eigen::Vector3f& middle, unsigned speckles) {
  Mesh mesh = shapes::sphere(middle, kRadius, 80);
  std::mt19937 random(speckles);
  for (size_t v = 0; v < mesh.vertices.size(); ++v) {
    const auto grey = static_cast<uint8_t>(speckles > 0 ? 60 + random() % 160 : 128);
    mesh.colours.push_back({grey, grey, grey});
  }
  return mesh;
}

/// A possible result of a deformation: a different mesh each time, with errors of 2 mm.
Mesh made_of(const Eigen::Vector3f& middle, unsigned seed) {
  Mesh mesh = shapes::sphere(middle, kRadius, 60 + static_cast<int>(seed) % 7);
  std::mt19937 random(seed);
  std::normal_distribution<float> error(0, 0.002F);
  for (Eigen::Vector3f& v : mesh.vertices) v += error(random) * (v - middle).normalized();
  return mesh;
}

PulseViews views(const Mesh& scene, const Mesh& surface) {
  const std::vector<Mask> masks = draw_silhouettes(scene, models());
  std::vector<Frame> frames;
  std::vector<const Frame*> pointers;
  for (size_t i = 0; i < masks.size(); ++i) {
    frames.push_back(
        observe("cam" + std::to_string(i), {}, draw_mesh(scene, models()[i]).view(), masks[i]));
  }
  for (const Frame& frame : frames) pointers.push_back(&frame);
  PulseViews views(models(), pointers, surface, kOptions.voxel_m);
  views.set_surface(surface);
  return views;
}

Mesh smoothed(Mesh mesh, const PulseViews& now, const PulseViews& before, const PulseViews& after) {
  const PulseViews* beside[] = {&before, &after};
  smooth_over_time(now, beside, kOptions, mesh);
  return mesh;
}

/// Half of the vertices are nearer to the other surface.
double median_apart_mm(const Mesh& mesh, const Mesh& other) {
  return upper_median(vertex_distances_mm(mesh, other));
}

TEST(TemporalSmoothing, halves_the_flicker_of_still_parts) {
  const Mesh scene = ball(kMiddle, 1);
  std::vector<Mesh> made;
  std::vector<PulseViews> pulses;
  for (unsigned pulse = 0; pulse < 4; ++pulse) {
    made.push_back(made_of(kMiddle, pulse + 1));
    pulses.push_back(views(scene, made.back()));
  }
  const Mesh first = smoothed(made[1], pulses[1], pulses[0], pulses[2]);
  const Mesh second = smoothed(made[2], pulses[2], pulses[1], pulses[3]);
  EXPECT_LT(median_apart_mm(second, first), 0.5 * median_apart_mm(made[2], made[1]));
  EXPECT_LT(median_apart_mm(first, scene), 0.75 * median_apart_mm(made[1], scene));
  EXPECT_TRUE(self_intersections(first).empty());
}

TEST(TemporalSmoothing, keeps_parts_that_move_in_the_images) {
  const Mesh now = made_of(kMiddle, 1);
  const PulseViews here = views(ball(kMiddle, 1), now);
  const PulseViews elsewhere = views(ball(kMiddle, 2), made_of(kMiddle, 2));
  EXPECT_EQ(smoothed(now, here, elsewhere, elsewhere).vertices, now.vertices);
}

TEST(TemporalSmoothing, uses_only_the_neighbour_without_motion) {
  const Mesh scene = ball(kMiddle, 1);
  const Mesh now = made_of(kMiddle, 1), before = made_of(kMiddle, 2);
  const PulseViews here = views(scene, now), still = views(scene, before);
  const PulseViews moved = views(ball(kMiddle, 2), made_of(kMiddle, 3));
  const PulseViews* only[] = {&still};
  Mesh expected = now;
  smooth_over_time(here, only, kOptions, expected);
  EXPECT_NE(expected.vertices, now.vertices);
  EXPECT_EQ(smoothed(now, here, still, moved).vertices, expected.vertices);
}

/// The motion of a plain ball is visible at its outline only.
TEST(TemporalSmoothing, follows_an_even_motion_that_images_do_not_show) {
  const auto at = [](int pulse) { return Eigen::Vector3f(0.002F * pulse, 0, 1); };
  const auto of = [&](int pulse) {
    return views(ball(at(pulse), 0), shapes::sphere(at(pulse), kRadius, 60));
  };
  const Mesh now = shapes::sphere(at(0), kRadius, 60);
  const Mesh smooth = smoothed(now, of(0), of(-1), of(1));
  EXPECT_LT(median_apart_mm(smooth, now), 0.1);
}

TEST(TemporalSmoothing, keeps_the_surface_beside_equal_surfaces_and_without_cameras) {
  const Mesh now = made_of(kMiddle, 1);
  const PulseViews same = views(ball(kMiddle, 1), now);
  EXPECT_EQ(smoothed(now, same, same, same).vertices, now.vertices);
  const std::vector<const Frame*> nothing(models().size(), nullptr);
  const PulseViews blind(models(), nothing, made_of(kMiddle, 2), kOptions.voxel_m);
  EXPECT_EQ(smoothed(now, same, blind, blind).vertices, now.vertices);
  EXPECT_EQ(smoothed(now, blind, same, same).vertices, now.vertices);
}

TEST(TemporalSmoothing, is_the_same_for_any_number_of_threads) {
  const Mesh scene = ball(kMiddle, 1), now = made_of(kMiddle, 1);
  const auto with_threads = [&](int threads) {
    return tbb::task_arena(threads).execute([&] {
      const PulseViews here = views(scene, now), before = views(scene, made_of(kMiddle, 2));
      return smoothed(now, here, before, before).vertices;
    });
  };
  EXPECT_EQ(with_threads(4), with_threads(1));
}

}  // namespace
}  // namespace v3d::recon
