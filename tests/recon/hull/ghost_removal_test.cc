#include "recon/hull/ghost_removal.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <numbers>
#include <random>
#include <vector>

#include "recon/hull/intersect.h"
#include "recon/render/renderer.h"
#include "recon/shapes.h"
#include "recon/volumes.h"

namespace v3d::recon {
namespace {

/// 1.2 m wide, around the origin.
const VoxelGrid kGrid{Eigen::Vector3d::Constant(-0.6), 0.01, {120, 120, 120}};

/// Cameras on a circle of 3 m around the origin. `height`: of every second one, metres; the others
/// are as far below the origin.
std::vector<CameraModel> ring(int cameras, double height) {
  std::vector<CameraModel> models;
  for (int n = 0; n < cameras; ++n) {
    const double angle = 2 * std::numbers::pi * n / cameras + 0.2;
    models.push_back(
        shapes::camera({3 * std::cos(angle), 3 * std::sin(angle), n % 2 ? height : -height},
                       {0, 0, 0}, {320, 240}, 400));
  }
  return models;
}

struct Ball {
  Eigen::Vector3d center;
  double radius = 0;

  bool contains(const Eigen::Vector3d& p) const { return (p - center).norm() < radius; }
};

SparseVolume volume_of(const std::vector<Ball>& balls) {
  return make_volume(kGrid, [&](int i, int j, int k) {
    return std::ranges::any_of(
        balls, [&](const Ball& ball) { return ball.contains(kGrid.center(i, j, k)); });
  });
}

/// The visual hull of balls.
SparseVolume hull_of(const std::vector<Ball>& balls, const std::vector<CameraModel>& cameras) {
  std::vector<Mask> masks;
  for (const CameraModel& camera : cameras) {
    Mask mask(camera.size());
    for (int y = 0; y < camera.size().height; ++y) {
      for (int x = 0; x < camera.size().width; ++x) {
        const Eigen::Vector3d ray = *camera.ray(Eigen::Vector2d(x, y));
        for (const Ball& ball : balls) {
          if (ray.cross(ball.center - camera.center()).norm() < ball.radius) mask.set(x, y);
        }
      }
    }
    masks.push_back(std::move(mask));
  }
  std::vector<const Mask*> pointers;
  for (const Mask& mask : masks) pointers.push_back(&mask);
  return Intersector(kGrid, cameras, 2).intersect(pointers);
}

bool has_voxel_at(const SparseVolume& volume, const Eigen::Vector3d& point) {
  const Eigen::Vector3d at = (point - kGrid.origin) / kGrid.voxel_m;
  return volume.get(static_cast<int>(at.x()), static_cast<int>(at.y()), static_cast<int>(at.z()));
}

int remove_ghosts(SparseVolume& volume, const std::vector<CameraModel>& cameras) {
  return GhostRemoval(kGrid, cameras).remove(volume, std::vector<uint8_t>(cameras.size(), 1));
}

size_t component_count(const SparseVolume& volume) {
  VolumeComponents components;
  components.find(volume);
  return components.count();
}

TEST(GhostRemoval, removes_the_ghosts_of_three_balls_and_keeps_the_balls) {
  const std::vector<CameraModel> cameras = ring(3, 0);
  const std::vector<Ball> balls = {
      {{0.3, 0.1, 0}, 0.1}, {{-0.25, 0.3, 0}, 0.09}, {{-0.1, -0.35, 0}, 0.08}};
  SparseVolume volume = hull_of(balls, cameras);
  const size_t before = component_count(volume);
  ASSERT_GT(before, balls.size()) << "the scene has ghosts";
  EXPECT_EQ(remove_ghosts(volume, cameras), static_cast<int>(before - balls.size()));
  EXPECT_EQ(component_count(volume), balls.size());
  for (const Ball& ball : balls) EXPECT_TRUE(has_voxel_at(volume, ball.center));
}

TEST(GhostRemoval, keeps_a_thrown_ball_a_blade_in_pieces_and_a_second_performer) {
  const std::vector<CameraModel> cameras = ring(8, 1);
  const std::vector<Ball> others = {
      {{0.2, 0, 0}, 0.15},      // performer
      {{-0.35, 0, 0}, 0.14},    // second performer: 11 litres
      {{0, 0.45, 0.2}, 0.035},  // thrown
      {{0.45, 0.2, 0.3}, 0.012},
      {{0.45, 0.25, 0.3}, 0.012}  // pieces of a blade
  };
  SparseVolume volume = volume_of(others);
  const SparseVolume before = volume;
  ASSERT_EQ(component_count(volume), others.size());
  EXPECT_EQ(remove_ghosts(volume, cameras), 0);
  EXPECT_EQ(volume, before);
}

TEST(GhostRemoval, keeps_small_objects_in_front_of_a_performer_for_some_cameras) {
  const std::vector<CameraModel> cameras = ring(8, 1);
  SparseVolume volume = volume_of({{{0, 0, 0}, 0.2}, {{0.3, 0.1, 0.05}, 0.03}});
  EXPECT_EQ(remove_ghosts(volume, cameras), 0);
}

/// Makes one of 200 pixels wrong.
void add_noise(Mask& mask, std::mt19937& random) {
  std::bernoulli_distribution is_wrong(0.005);
  for (int y = 0; y < mask.size().height; ++y) {
    for (int x = 0; x < mask.size().width; ++x) {
      if (is_wrong(random)) mask.set(x, y, !mask.get(x, y));
    }
  }
}

/// The number of voxels in a part of the space, metres.
int64_t count_in(const SparseVolume& volume, const Eigen::Vector3d& low,
                 const Eigen::Vector3d& high) {
  int64_t count = 0;
  for (int k = 0; k < kGrid.counts[2]; ++k) {
    for (int j = 0; j < kGrid.counts[1]; ++j) {
      for (int i = 0; i < kGrid.counts[0]; ++i) {
        const Eigen::Vector3d p = kGrid.center(i, j, k);
        const bool is_inside = (p.array() > low.array()).all() && (p.array() < high.array()).all();
        count += is_inside && volume.get(i, j, k) ? 1 : 0;
      }
    }
  }
  return count;
}

TEST(GhostRemoval, keeps_the_pieces_of_a_rendered_blade_whose_silhouettes_have_wrong_pixels) {
  const std::vector<CameraModel> cameras = ring(8, 1);
  Mesh scene = shapes::sphere({0, 0, -0.1F}, 0.2F, 24);  // performer
  shapes::append(scene, shapes::box({0.1F, -0.015F, 0.3F}, {0.3F, 0.015F, 0.33F}));
  shapes::append(scene, shapes::box({0.36F, -0.015F, 0.3F}, {0.56F, 0.015F, 0.33F}));
  std::vector<Mask> masks = draw_silhouettes(scene, cameras);
  std::mt19937 random(1);
  std::vector<const Mask*> pointers;
  for (Mask& mask : masks) {
    add_noise(mask, random);
    pointers.push_back(&mask);
  }
  SparseVolume volume = Intersector(kGrid, cameras, 2).intersect(pointers);
  ASSERT_GE(component_count(volume), 3U) << "the performer and two pieces";
  const auto pieces = [&] {
    return std::array{count_in(volume, {0.1, -0.1, 0.2}, {0.33, 0.1, 0.4}),
                      count_in(volume, {0.33, -0.1, 0.2}, {0.6, 0.1, 0.4})};
  };
  const auto before = pieces();
  remove_ghosts(volume, cameras);
  const auto after = pieces();
  for (size_t n = 0; n < before.size(); ++n) {
    EXPECT_GT(before[n], 50) << n;
    EXPECT_GE(after[n], 9 * before[n] / 10) << n;
  }
}

TEST(GhostRemoval, keeps_a_second_performer_of_whom_the_space_holds_eight_litres) {
  const std::vector<CameraModel> cameras = ring(8, 1);
  SparseVolume volume = volume_of({{{0.2, 0, 0}, 0.2}, {{-0.6, 0, 0}, 0.155}});
  const SparseVolume before = volume;
  const int64_t second = count_in(volume, {-0.6, -0.6, -0.6}, {-0.3, 0.6, 0.6});
  EXPECT_LT(static_cast<double>(second) * kGrid.voxel_volume_m3(), GhostOptions().max_volume_m3)
      << "its volume alone does not keep it";
  EXPECT_EQ(remove_ghosts(volume, cameras), 0);
  EXPECT_EQ(volume, before);
}

/// A hollow ball of 30 cm with a speck inside. No line of sight reaches the speck except those of
/// `cameras` for which the ball has a hole.
SparseVolume speck_in_a_shell(const std::vector<CameraModel>& cameras, size_t holes) {
  return make_volume(kGrid, [&](int i, int j, int k) {
    const Eigen::Vector3d p = kGrid.center(i, j, k);
    const bool is_speck = p.norm() < 0.02;
    if (is_speck || p.norm() < 0.25 || p.norm() > 0.3) return is_speck;
    for (size_t c = 0; c < holes; ++c) {
      const Eigen::Vector3d to = cameras[c].center().normalized();
      if (p.cross(to).norm() < 0.06) return false;  // on both sides of the speck
    }
    return true;
  });
}

TEST(GhostRemoval, removes_a_component_that_fewer_than_three_of_eight_cameras_prove) {
  const std::vector<CameraModel> cameras = ring(8, 1);
  for (const size_t holes : {0U, 1U, 2U, 3U, 4U}) {
    SparseVolume volume = speck_in_a_shell(cameras, holes);
    ASSERT_EQ(component_count(volume), 2U);
    EXPECT_EQ(remove_ghosts(volume, cameras), holes < 3 ? 1 : 0) << holes;
    EXPECT_EQ(has_voxel_at(volume, {0, 0, 0}), holes >= 3) << holes;
  }
}

TEST(GhostRemoval, counts_only_cameras_that_take_part) {
  const std::vector<CameraModel> cameras = ring(8, 1);
  SparseVolume volume = speck_in_a_shell(cameras, 3);
  std::vector<uint8_t> takes_part(cameras.size(), 1);
  takes_part[0] = 0;
  EXPECT_EQ(GhostRemoval(kGrid, cameras).remove(volume, takes_part), 1);
}

TEST(GhostRemoval, keeps_components_of_ten_litres_without_proof) {
  const std::vector<CameraModel> cameras = ring(8, 1);
  const auto shell_with = [&](double radius) {
    return make_volume(kGrid, [&](int i, int j, int k) {
      const double r = kGrid.center(i, j, k).norm();
      return r < radius || (r > 0.3 && r < 0.4);
    });
  };
  SparseVolume large = shell_with(0.14);  // 11.5 litres
  EXPECT_EQ(remove_ghosts(large, cameras), 0);
  SparseVolume small = shell_with(0.12);  // 7.2 litres
  EXPECT_EQ(remove_ghosts(small, cameras), 1);
}

}  // namespace
}  // namespace v3d::recon
