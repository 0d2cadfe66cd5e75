#include <gtest/gtest.h>
#include <tbb/task_arena.h>

#include <numbers>

#include "base/geometry/rigid_transform.h"
#include "base/image/mask_operations.h"
#include "recon/render/renderer.h"
#include "recon/shapes.h"
#include "recon/silhouettes/leave_one_out_hull.h"
#include "recon/silhouettes/silhouette_repair.h"

namespace v3d::recon {
namespace {

constexpr ImageSize kSize{160, 120};
constexpr size_t kCameras = 10;
const Box kSpace{{-0.4, -0.4, 0.5}, {0.4, 0.4, 1.6}};
constexpr double kVoxelM = 0.02;
/// Size of the head. No voxel of it is on a rim, so all cameras that have the head show all of it.
const Box kInsideHead{{-0.06, -0.06, 1.22}, {0.06, 0.06, 1.38}};
const JointMissingOptions kOptions{};

Mesh body() { return shapes::box({-0.2F, -0.15F, 0.7F}, {0.2F, 0.15F, 1.2F}); }
Mesh head() { return shapes::box({-0.08F, -0.08F, 1.2F}, {0.08F, 0.08F, 1.4F}); }

/// A body with a head that some masks lack.
struct Studio {
  Rig rig;
  std::vector<CameraModel> models;
  std::vector<Mask> masks, heads;
  VoxelGrid grid = VoxelGrid::covering(kInsideHead, kVoxelM);

  explicit Studio(const std::vector<size_t>& lost) {
    for (size_t c = 0; c < kCameras; ++c) {
      const double angle = 2 * std::numbers::pi * (static_cast<double>(c) + 0.3) / kCameras;
      models.push_back(shapes::camera({2.5 * std::cos(angle), 2.5 * std::sin(angle), 1.3},
                                      {0, 0, 1}, kSize, 170));
      rig.push_back({"cam" + std::to_string(c), models.back()});
    }
    Mesh whole = body();
    shapes::append(whole, head());
    masks = draw_silhouettes(whole, models);
    const std::vector<Mask> headless = draw_silhouettes(body(), models);
    for (size_t c = 0; c < kCameras; ++c) heads.push_back(difference_of(masks[c], headless[c]));
    for (const size_t c : lost) masks[c] = headless[c];
  }

  std::vector<const Mask*> borrowed() const {
    std::vector<const Mask*> all;
    for (const Mask& mask : masks) all.push_back(&mask);
    return all;
  }

  std::vector<Mask> missing(const std::vector<const Mask*>& seen,
                            const JointMissingOptions& options = kOptions) const {
    std::vector<VoxelCamera> lenses;
    for (const CameraModel& model : models) lenses.emplace_back(model, grid);
    LeaveOneOutHull hull(rig, kSpace, kVoxelM, 4);
    const std::vector<Mask> explained = hull.silhouettes(seen);
    std::vector<Mask> unexplained(kCameras);  // without narrow rims
    for (size_t c = 0; c < kCameras; ++c) {
      if (seen[c] != nullptr) unexplained[c] = open(difference_of(*seen[c], explained[c]), 2);
    }
    return joint_missing_foreground(grid, lenses, seen, unexplained, options);
  }
  std::vector<Mask> missing() const { return missing(borrowed()); }
};

/// A voxel is about 1.4 pixels wide; one pixel is enough for it.
Mask filled(const Mask& missing) { return dilate(missing, 1); }

std::vector<size_t> accused(const std::vector<Mask>& missing) {
  std::vector<size_t> cameras;
  for (size_t c = 0; c < missing.size(); ++c) {
    if (missing[c].size().width > 0) cameras.push_back(c);
  }
  return cameras;
}

TEST(JointMissingForeground, finds_the_piece_that_several_silhouettes_lack) {
  for (const std::vector<size_t>& lost : {std::vector<size_t>{2, 3}, {0, 5}, {1, 4, 8}}) {
    Studio studio(lost);
    EXPECT_EQ(accused(studio.missing()), lost);
    studio.grid = VoxelGrid::covering(kSpace, kVoxelM);
    const std::vector<Mask> missing = studio.missing();
    for (const size_t c : lost) {
      ASSERT_GT(studio.heads[c].count(), 60);
      EXPECT_GT(intersection_over_union(filled(missing[c]), studio.heads[c]), 0.6) << c;
    }
  }
}

TEST(JointMissingForeground, ignores_foreground_that_only_one_camera_lacks) {
  EXPECT_EQ(accused(Studio({4}).missing()), std::vector<size_t>());
}

TEST(JointMissingForeground, accepts_background_of_a_majority) {
  EXPECT_EQ(accused(Studio({0, 1, 2, 3}).missing()), std::vector<size_t>())
      << "more than 0.3 of ten";
  JointMissingOptions lenient;
  lenient.max_missing_part = 0.5;
  lenient.supporting_per_missing = 1;
  const Studio studio({0, 1, 2, 3});
  EXPECT_EQ(accused(studio.missing(studio.borrowed(), lenient)), (std::vector<size_t>{0, 1, 2, 3}));
}

TEST(JointMissingForeground, uses_only_participating_cameras) {
  const Studio studio({2, 3});
  std::vector<const Mask*> seen = studio.borrowed();
  seen[3] = nullptr;
  EXPECT_EQ(accused(studio.missing(seen)), std::vector<size_t>()) << "one denies it";
  seen = studio.borrowed();
  seen[7] = nullptr;
  EXPECT_EQ(accused(studio.missing(seen)), (std::vector<size_t>{2, 3}));
}

TEST(JointMissingForeground, requires_enough_cameras_with_unexplained_foreground) {
  const Studio studio({2, 3});
  JointMissingOptions strict;
  strict.min_supporting = 9;
  EXPECT_EQ(accused(studio.missing(studio.borrowed(), strict)), std::vector<size_t>());
  strict.min_supporting = 3;
  strict.supporting_per_missing = 5;
  EXPECT_EQ(accused(studio.missing(studio.borrowed(), strict)), std::vector<size_t>());
}

TEST(JointMissingForeground, finds_nothing_when_all_foreground_is_explained) {
  EXPECT_EQ(accused(Studio({}).missing()), std::vector<size_t>());
}

TEST(JointMissingForeground, returns_the_same_for_any_number_of_threads) {
  const auto with_threads = [](int threads) {
    return tbb::task_arena(threads).execute([] { return Studio({1, 4, 8}).missing(); });
  };
  EXPECT_EQ(with_threads(1), with_threads(4));
}

}  // namespace
}  // namespace v3d::recon
