#include "recon/hull/intersect.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>
#include <tbb/global_control.h>
#include <tbb/task_arena.h>

#include <numbers>

#include "base/core/error.h"
#include "support/allocation_count.h"
#include "support/instruction_sets.h"
#include "tests/recon/random_rig.h"

namespace v3d::recon {
namespace {

/// Cameras with their silhouettes of one pulse.
struct Scene {
  std::vector<CameraModel> cameras;
  std::vector<Mask> masks;

  std::vector<const Mask*> mask_pointers() const {
    std::vector<const Mask*> pointers;
    for (const Mask& mask : masks) pointers.push_back(&mask);
    return pointers;
  }
};

Scene random_scene(const VoxelGrid& grid, int camera_count) {
  Scene scene;
  for (int n = 0; n < camera_count; ++n) {
    scene.cameras.push_back(random_camera(box_of(grid)));
    scene.masks.push_back(random_mask(scene.cameras.back().size()));
  }
  return scene;
}

/// Cameras on a circle of 3 m that see a ball, at half height.
Scene ball_scene(int camera_count, const Eigen::Vector3d& center, double radius) {
  Scene scene;
  Eigen::Matrix3d k;
  k << 400, 0, 255.5, 0, 400, 191.5, 0, 0, 1;
  for (int n = 0; n < camera_count; ++n) {
    const double angle = 2 * std::numbers::pi * n / camera_count;
    const Eigen::Vector3d eye(3 * std::cos(angle), 3 * std::sin(angle), n % 2 == 0 ? 2.4 : 0.3);
    scene.cameras.emplace_back(ImageSize{512, 384}, k, Distortion{}, look_at(eye, {0, 0, 1}));
    Mask mask({512, 384});
    for (int y = 0; y < 384; ++y) {
      for (int x = 0; x < 512; ++x) {
        const Eigen::Vector3d ray = *scene.cameras.back().ray(Eigen::Vector2d(x, y));
        if (ray.cross(center - eye).norm() < radius) mask.set(x, y);
      }
    }
    scene.masks.push_back(std::move(mask));
  }
  return scene;
}

SparseVolume intersect(const VoxelGrid& grid, const Scene& scene, int min_views) {
  return Intersector(grid, scene.cameras, min_views).intersect(scene.mask_pointers());
}

VoxelGrid random_grid() {
  const auto edge = [] { return uniform_int(1, 70); };
  return {{uniform(-1, 1), uniform(-1, 1), uniform(-1, 1)},
          uniform(0.002, 0.05),
          {edge(), edge(), edge()}};
}

RC_GTEST_PROP(Intersector, equals_the_brute_force_intersection_voxel_for_voxel, ()) {
  const VoxelGrid grid = random_grid();
  const int cameras = uniform_int(1, 9);
  const int min_views = uniform_int(1, cameras + 1);
  const Scene scene = random_scene(grid, cameras);
  const SparseVolume truth =
      intersect_brute_force(grid, scene.cameras, scene.mask_pointers(), min_views);
  const SparseVolume found = intersect(grid, scene, min_views);
  const int64_t voxels = grid.counts[0] * grid.counts[1] * grid.counts[2];
  RC_CLASSIFY(truth.count() == 0, "empty");
  RC_CLASSIFY(truth.count() == voxels, "full");
  RC_ASSERT(found.count() == truth.count());
  RC_ASSERT(found == truth);
}

RC_GTEST_PROP(Intersector, takes_what_lies_beyond_the_fold_of_a_lens_as_not_seen, ()) {
  const VoxelGrid grid = random_grid();
  Scene scene = random_scene(grid, 1);
  // A barrel lens that folds inside its own image and has background everywhere.
  const CameraModel wide = random_camera(box_of(grid));
  Eigen::Matrix3d k;
  k << 60, 0, 49.5, 0, 60, 49.5, 0, 0, 1;
  scene.cameras.emplace_back(ImageSize{100, 100}, k, Distortion{uniform(-2, -0.3)},
                             wide.cam_from_world());
  RC_ASSERT(scene.cameras.back().max_radius2() < 2);
  scene.masks.emplace_back(ImageSize{100, 100});
  Mask& first = scene.masks.front();
  for (int y = 0; y < first.size().height; ++y) first.fill_row(y, 0, first.size().width);
  RC_ASSERT(intersect(grid, scene, 1) ==
            intersect_brute_force(grid, scene.cameras, scene.mask_pointers(), 1));
}

RC_GTEST_PROP(Intersector, does_not_depend_on_the_previous_frame, ()) {
  const VoxelGrid grid = random_grid();
  Scene scene = random_scene(grid, 4);
  Intersector intersector(grid, scene.cameras, 1);
  intersector.intersect(scene.mask_pointers());
  for (Mask& mask : scene.masks) mask = random_mask(mask.size());
  std::vector<const Mask*> masks = scene.mask_pointers();
  masks[uniform_int(0, 4)] = nullptr;
  RC_ASSERT(intersector.intersect(masks) == intersect_brute_force(grid, scene.cameras, masks, 1));
}

RC_GTEST_PROP(Intersector, gives_the_same_bytes_with_every_instruction_set_of_this_processor, ()) {
  const VoxelGrid grid = random_grid();
  const Scene scene = random_scene(grid, 3);
  const SparseVolume best = intersect(grid, scene, 1);
  on_every_instruction_set([&] {
    const SparseVolume found = intersect(grid, scene, 1);
    RC_ASSERT(found == best);
  });
}

TEST(Intersector, allocates_nothing_after_the_first_frames) {
  const VoxelGrid grid = VoxelGrid::covering({{-1, -1, 0}, {1, 1, 2}}, 0.01);
  const Scene scene = ball_scene(8, {0, 0.1, 0.9}, 0.5);
  const std::vector<const Mask*> masks = scene.mask_pointers();
  Intersector intersector(grid, scene.cameras, 2);
  SparseVolume volume;
  tbb::task_arena single(1);
  const auto frame = [&] { single.execute([&] { intersector.intersect(masks, volume); }); };
  frame();
  const int64_t before = test::allocations();
  frame();
  frame();
  EXPECT_EQ(test::allocations(), before);
  EXPECT_GT(volume.count(), 0);
}

TEST(Intersector, finds_a_ball_with_little_excess) {
  const Eigen::Vector3d center(0.1, -0.2, 1.1);
  const VoxelGrid grid = VoxelGrid::covering({{-1, -1, 0}, {1, 1, 2}}, 0.02);
  const SparseVolume volume = intersect(grid, ball_scene(16, center, 0.4), 4);
  const double volume_m3 = static_cast<double>(volume.count()) * grid.voxel_volume_m3();
  const double ball_m3 = 4.0 / 3 * std::numbers::pi * 0.4 * 0.4 * 0.4;
  EXPECT_GT(volume_m3, 0.97 * ball_m3);
  EXPECT_LT(volume_m3, 1.15 * ball_m3);
  EXPECT_TRUE(volume.get(55, 40, 55));
}

TEST(Intersector, returns_the_same_bytes_for_any_number_of_threads) {
  const tbb::global_control more_threads_than_cores(tbb::global_control::max_allowed_parallelism,
                                                    5);
  const VoxelGrid grid = VoxelGrid::covering({{-1, -1, 0}, {1, 1, 2}}, 0.01);
  const Scene scene = ball_scene(8, {0, 0.1, 0.9}, 0.5);
  tbb::task_arena single(1);
  const SparseVolume one = single.execute([&] { return intersect(grid, scene, 2); });
  EXPECT_GT(one.count(), 0);
  for (const int threads : {2, 3, 5}) {
    tbb::task_arena arena(threads);
    EXPECT_TRUE(one == arena.execute([&] { return intersect(grid, scene, 2); }));
  }
}

TEST(Intersector, keeps_space_empty_that_too_few_cameras_see) {
  const VoxelGrid grid = VoxelGrid::covering({{-1, -1, 0}, {1, 1, 2}}, 0.05);
  Scene scene = ball_scene(3, {0, 0, 1}, 10);  // everything is foreground
  const auto seen_by_all = [&](int i, int j, int k) {
    for (const CameraModel& camera : scene.cameras) {
      if (!project_voxel(VoxelCamera(camera, grid), i, j, k).seen) return false;
    }
    return true;
  };
  EXPECT_TRUE(intersect(grid, scene, 3) == make_volume(grid, seen_by_all));
  EXPECT_EQ(intersect(grid, scene, 4).count(), 0);
}

TEST(Intersector, lets_a_close_up_constrain_only_what_it_sees) {
  const VoxelGrid grid = VoxelGrid::covering({{-1, -1, 0}, {1, 1, 2}}, 0.02);
  Scene scene = ball_scene(8, {0, 0, 1}, 0.4);
  const SparseVolume without = intersect(grid, scene, 4);
  Eigen::Matrix3d tele;
  tele << 4000, 0, 255.5, 0, 4000, 191.5, 0, 0, 1;
  // It looks at the middle of the ball: all that it sees is foreground.
  scene.cameras.emplace_back(ImageSize{512, 384}, tele, Distortion{},
                             look_at({3, 0, 1}, {0, 0, 1}));
  Mask all({512, 384});
  for (int y = 0; y < 384; ++y) all.fill_row(y, 0, 512);
  scene.masks.push_back(all);
  EXPECT_TRUE(intersect(grid, scene, 4) == without);
}

TEST(Intersector, is_empty_without_cameras_and_without_silhouettes) {
  const VoxelGrid grid = small_grid(9, 9, 9);
  EXPECT_EQ(intersect(grid, {}, 1).count(), 0);
  Scene scene = ball_scene(2, {0, 0, 1}, 0.4);
  const std::vector<const Mask*> none(2, nullptr);
  EXPECT_EQ(Intersector(grid, scene.cameras, 1).intersect(none).count(), 0);
}

TEST(Intersector, rejects_invalid_input) {
  const VoxelGrid grid = small_grid(8, 8, 8);
  const Scene scene = ball_scene(1, {0, 0, 1}, 0.4);
  EXPECT_THROW(Intersector(grid, scene.cameras, 0), InputError);
  const std::vector<CameraModel> crowd(Intersector::kMaxCameras + 1, scene.cameras[0]);
  EXPECT_THROW(Intersector(grid, crowd, 1), InputError);
  VoxelGrid long_grid = grid;
  long_grid.counts[1] = VoxelGrid::kMaxCount + 1;
  EXPECT_THROW(Intersector(long_grid, scene.cameras, 1), InputError);
}

TEST(SparseVolume, counts_and_finds_its_voxels) {
  const SparseVolume volume = make_volume(small_grid(20, 9, 17), [](int i, int j, int k) {
    return (i == 19 && j == 8 && k == 16) || (i == 8 && j == 7 && k == 0);
  });
  EXPECT_EQ(volume.count(), 2);
  EXPECT_EQ(volume.bricks().size(), 2U);
  EXPECT_TRUE(volume.get(19, 8, 16));
  EXPECT_TRUE(volume.get(8, 7, 0));
  EXPECT_FALSE(volume.get(8, 7, 1));
  EXPECT_FALSE(volume.get(20, 8, 16));
  EXPECT_FALSE(volume.get(-1, 7, 0));
  EXPECT_EQ(volume.coords()[0], (codec::BrickCoord{1, 0, 0}));
  EXPECT_EQ(volume.bricks()[0][0], uint64_t{1} << 56);
  EXPECT_EQ(volume.index_of({0, 0, 0}), -1);
}

TEST(SparseVolume, counts_what_two_have_in_common_and_what_one_has_alone) {
  const VoxelGrid grid = small_grid(20, 9, 17);
  const auto low = make_volume(grid, [](int i, int, int) { return i < 12; });
  const auto high = make_volume(grid, [](int i, int, int) { return i >= 10 && i < 15; });
  EXPECT_EQ(count_common(low, high), 2 * 9 * 17);
  EXPECT_EQ(count_differing(low, high), (10 + 3) * 9 * 17);
  EXPECT_EQ(count_differing(high, low), (10 + 3) * 9 * 17);
  EXPECT_EQ(count_differing(low, SparseVolume(grid)), low.count());
}

}  // namespace
}  // namespace v3d::recon
