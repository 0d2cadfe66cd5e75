#include "calib/rig/silhouette_refinement.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>

#include "base/core/error.h"
#include "sim/rendering/scene.h"
#include "support/displaced_rig.h"
#include "support/message_of.h"

namespace v3d::calib {
namespace {

using testing::HasSubstr;

constexpr ImageSize kSize{512, 384};

class SilhouetteRefining : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    truth_ = sim::make_rig(8, kSize, 3);
    for (int instant = 0; instant < 12; ++instant) {
      masks_.emplace_back();
      for (const RigCamera& camera : truth_) {
        masks_.back().push_back(sim::true_silhouette(camera, 0.33 * instant, 3));
      }
    }
  }
  static std::vector<SilhouetteSet> sets() {
    std::vector<SilhouetteSet> result;
    for (const auto& instant : masks_) {
      result.emplace_back();
      for (const Mask& mask : instant) result.back().push_back(&mask);
    }
    return result;
  }
  static inline Rig truth_;
  static inline std::vector<std::vector<Mask>> masks_;
};

TEST_F(SilhouetteRefining, finds_equal_tangent_planes_for_true_cameras) {
  const std::vector<CameraModel> cameras = models_of(truth_);
  std::vector<Outline> outlines;
  for (size_t c = 0; c < cameras.size(); ++c) {
    outlines.push_back(outline_of(masks_[0][c], cameras[c]));
  }
  const std::vector<EpipolarTangent> tangents = epipolar_tangents(cameras, outlines);
  ASSERT_GT(tangents.size(), 20U);
  int close = 0;
  for (const EpipolarTangent& t : tangents) {
    const double angle = angle_between(t, cameras[t.a], cameras[t.b]);
    close += std::abs(angle) * t.px_per_radian() < 1;
  }
  EXPECT_GT(close, 0.8 * static_cast<double>(tangents.size()));
}

TEST_F(SilhouetteRefining, reduces_a_calibration_error_of_one_pixel) {
  const Rig before = test::displaced(truth_, 1, 5);
  const RefineResult result = refine_by_silhouettes(before, sets(), {});
  EXPECT_TRUE(result.better);
  RecordProperty("before", std::to_string(test::error_px(before, truth_)));
  RecordProperty("after", std::to_string(test::error_px(result.rig, truth_)));
  EXPECT_LT(test::error_px(result.rig, truth_), 0.6 * test::error_px(before, truth_));
}

/// The positions of cameras in one row do not determine the rig's rotation about the row.
TEST_F(SilhouetteRefining, keeps_the_orientation_of_cameras_in_one_row) {
  Rig row;
  for (int c = 0; c < 4; ++c) {
    const RigidTransform pose = look_at({0.8 * c - 1.2, -3.5, 1.2}, {0, 0, 0.9});
    const CameraModel& lens = truth_[0].model;
    row.push_back({"cam0" + std::to_string(c),
                   CameraModel(lens.size(), lens.matrix(), lens.distortion(), pose)});
  }
  std::vector<std::vector<Mask>> masks(12);
  std::vector<SilhouetteSet> in_row(12);
  for (size_t instant = 0; instant < in_row.size(); ++instant) {
    for (const RigCamera& camera : row) {
      masks[instant].push_back(
          sim::true_silhouette(camera, 0.33 * static_cast<double>(instant), 3));
    }
    for (const Mask& mask : masks[instant]) in_row[instant].push_back(&mask);
  }
  const Rig before = test::displaced(row, 8, 5);
  const RefineResult result = refine_by_silhouettes(before, in_row, {.expected_px = 8});
  ASSERT_TRUE(result.better);
  for (size_t c = 0; c < row.size(); ++c) {
    const Eigen::Matrix3d turn = result.rig[c].model.cam_from_world().rotation *
                                 before[c].model.cam_from_world().rotation.transpose();
    EXPECT_LT(Eigen::AngleAxisd(turn).angle(), 0.05) << "radians, camera " << c;
  }
}

TEST_F(SilhouetteRefining, keeps_a_correct_rig) {
  const RefineResult result = refine_by_silhouettes(truth_, sets(), {});
  EXPECT_FALSE(result.better);
  EXPECT_LT(test::error_px(result.rig, truth_), 1e-9);
}

/// A square of 3x3 pixels at the centre of another camera; empty where the image does not show it.
Mask square_at(const CameraModel& model, const CameraModel& other) {
  Mask mask(model.size());
  const auto pixel = model.project(other.center());
  if (!pixel || !model.inside_image(*pixel)) return mask;
  const auto x = static_cast<int>(pixel->x()), y = static_cast<int>(pixel->y());
  for (int row = std::max(0, y - 1); row <= std::min(kSize.height - 1, y + 1); ++row) {
    mask.fill_row(row, std::max(0, x - 1), std::min(kSize.width, x + 2));
  }
  return mask;
}

TEST_F(SilhouetteRefining, is_no_improvement_where_the_held_out_tangents_are_gone) {
  // The true baseline of two cameras passes through these silhouettes, that of the displaced ones
  // does not.
  std::vector<std::pair<Mask, Mask>> held_out;
  for (size_t c = 0; c < 4; ++c) {
    const CameraModel &a = truth_[c].model, &b = truth_[c + 4].model;
    held_out.emplace_back(square_at(a, b), square_at(b, a));
  }
  std::vector<SilhouetteSet> all = sets();
  for (size_t c = 0; c < 4; ++c) {
    SilhouetteSet& set = all[3 * c + 2];
    std::fill(set.begin(), set.end(), nullptr);
    set[c] = &held_out[c].first;
    set[c + 4] = &held_out[c].second;
  }
  const Rig before = test::displaced(truth_, 8, 5);
  const RefineResult result = refine_by_silhouettes(before, all, {.expected_px = 8});
  EXPECT_GT(result.before_px, 0);
  EXPECT_FALSE(result.better);
  EXPECT_EQ(test::error_px(result.rig, truth_), test::error_px(before, truth_));
}

TEST_F(SilhouetteRefining, reports_too_few_silhouettes) {
  std::vector<SilhouetteSet> few = sets();
  few.resize(3);
  EXPECT_THAT(test::message_of<InputError>([&] { refine_by_silhouettes(truth_, few, {}); }),
              HasSubstr("3 instants are too few"));
  const std::vector<SilhouetteSet> none(9, SilhouetteSet(truth_.size(), nullptr));
  EXPECT_THAT(test::message_of<InputError>([&] { refine_by_silhouettes(truth_, none, {}); }),
              HasSubstr("only 0 epipolar tangents"));
}

}  // namespace
}  // namespace v3d::calib
