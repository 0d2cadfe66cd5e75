#include "recon/silhouettes/leave_one_out_hull.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include "recon/random_rig.h"
#include "recon/render/renderer.h"
#include "recon/shapes.h"

namespace v3d::recon {
namespace {

constexpr int kMinViews = 2;
constexpr double kVoxel = 0.05;
const Box kSpace{{-0.6, -0.6, -0.6}, {0.6, 0.6, 0.6}};

/// Cameras around a body, and its silhouettes.
class LeaveOneOut : public testing::Test {
 protected:
  LeaveOneOut() {
    for (int c = 0; c < 5; ++c) {
      const double angle = 1.2 * c;
      rig_.push_back({"cam0" + std::to_string(c),
                      shapes::camera({3 * std::cos(angle), 3 * std::sin(angle), 0.4 * c}, {0, 0, 0},
                                     {160, 120}, 200)});
      const Mesh body = shapes::sphere({0.1F, 0, 0}, 0.4F, 24);
      masks_.push_back(draw_silhouette(body, rig_.back().model));
    }
    for (const Mask& mask : masks_) views_.push_back(&mask);
  }
  LeaveOneOutHull hull() const { return {rig_, kSpace, kVoxel, kMinViews}; }
  SparseVolume reference(std::vector<const Mask*> views, const VoxelGrid& grid) const {
    return intersect_brute_force(grid, models_of(rig_), views, kMinViews);
  }

  Rig rig_;
  std::vector<Mask> masks_;
  std::vector<const Mask*> views_;
};

TEST_F(LeaveOneOut, has_a_voxel_for_four_pixels_and_at_most_256_along_the_longest_edge) {
  EXPECT_DOUBLE_EQ(voxel_for_silhouettes(rig_, kSpace), 1.2 / 40);
  rig_.push_back({"wide", shapes::camera({3, 0, 0}, {0, 0, 0}, {2048, 1536}, 2000)});
  EXPECT_DOUBLE_EQ(voxel_for_silhouettes(rig_, kSpace), 1.2 / 256);
}

TEST_F(LeaveOneOut, has_the_volume_of_all_masks_but_one) {
  LeaveOneOutHull hull = this->hull();
  EXPECT_EQ(hull.volume(views_), reference(views_, hull.grid()));
  const int64_t of_all = hull.volume(views_).count();
  EXPECT_GT(of_all, 500);
  for (size_t c = 0; c < views_.size(); ++c) {
    std::vector<const Mask*> others = views_;
    others[c] = nullptr;
    EXPECT_EQ(hull.volume(views_, c), reference(others, hull.grid())) << c;
    EXPECT_GE(hull.volume(views_, c).count(), of_all) << c;
  }
}

TEST_F(LeaveOneOut, depends_not_on_the_mask_of_the_camera_that_is_left_out) {
  LeaveOneOutHull hull = this->hull();
  for (size_t c = 0; c < views_.size(); ++c) {
    const Mask expected = hull.silhouette(views_, c);
    const Mask nothing(masks_[c].size());
    std::vector<const Mask*> changed = views_;
    changed[c] = &nothing;
    EXPECT_EQ(hull.silhouette(changed, c), expected) << c;
  }
}

TEST_F(LeaveOneOut, predicts_a_silhouette_that_contains_the_true_one) {
  LeaveOneOutHull hull = this->hull();
  const std::vector<Mask> predicted = hull.silhouettes_of_each(views_);
  for (size_t c = 0; c < views_.size(); ++c) {
    int missing = 0, inside = 0;
    for (int y = 0; y < 120; ++y) {
      for (int x = 0; x < 160; ++x) {
        inside += masks_[c].get(x, y);
        missing += masks_[c].get(x, y) && !predicted[c].get(x, y);
      }
    }
    // A voxel is 3 pixels wide: only the rim may be missing.
    EXPECT_LT(missing, 0.1 * inside) << c;
  }
}

TEST_F(LeaveOneOut, pauses_before_each_hull) {
  LeaveOneOutHull hull(rig_, kSpace, kVoxel, kMinViews);
  int pauses = 0;
  hull.set_pause([&] { ++pauses; });
  hull.silhouettes_of_each(views_);
  EXPECT_EQ(pauses, std::ssize(views_));
}

TEST_F(LeaveOneOut, skips_cameras_without_a_mask) {
  views_[2] = nullptr;
  LeaveOneOutHull hull = this->hull();
  const std::vector<Mask> each = hull.silhouettes_of_each(views_);
  ASSERT_EQ(each.size(), views_.size());
  for (size_t c = 0; c < views_.size(); ++c) {
    EXPECT_EQ(each[c], c == 2 ? Mask() : hull.silhouette(views_, c)) << c;
  }
  const std::vector<Mask> of_all = hull.silhouettes(views_);
  ASSERT_EQ(of_all.size(), views_.size());
  EXPECT_EQ(of_all[2].size(), rig_[2].model.size()) << "every camera sees the hull";
}

}  // namespace
}  // namespace v3d::recon
