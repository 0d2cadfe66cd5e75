#include "calib/silhouette_refine.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "calib/layout.h"
#include "calib/tangents.h"
#include "sim/noise.h"
#include "sim/scene.h"
#include "support/message_of.h"

namespace v3d::calib {
namespace {

using Eigen::Vector3d;
using testing::HasSubstr;

constexpr ImageSize kSize{512, 384};

/// Every camera turned and moved so that what it sees shifts by about so many pixels either way.
Rig disturbed(const Rig& rig, double px, uint64_t seed) {
  Rig result = rig;
  for (size_t c = 0; c < rig.size(); ++c) {
    const CameraModel& m = rig[c].model;
    const double radians = px / m.matrix()(0, 0);
    const auto any = [&](uint64_t k) {
      return Vector3d(sim::uniform(seed, 100 * c + k, -1.7, 1.7),
                      sim::uniform(seed, 100 * c + k + 1, -1.7, 1.7),
                      sim::uniform(seed, 100 * c + k + 2, -1.7, 1.7));
    };
    const RigidTransform turn = RigidTransform::from_rodrigues(radians * any(0), radians * any(5));
    result[c].model = CameraModel(m.size(), m.matrix(), m.distortion(), turn * m.cam_from_world());
  }
  return result;
}

/// Root mean square distance of where the two rigs see places in the space, pixels, after the
/// worlds are brought together.
double error_px(const Rig& rig, const Rig& truth) {
  std::vector<Vector3d> from, to;
  for (size_t c = 0; c < rig.size(); ++c) {
    from.push_back(rig[c].model.center());
    to.push_back(truth[c].model.center());
  }
  const Rig moved = moved_rig(rig, align_points(from, to, true));
  double sum = 0;
  int count = 0;
  for (size_t c = 0; c < rig.size(); ++c) {
    for (const Vector3d& place : {Vector3d(0, 0, 0.2), Vector3d(0.5, 0, 1), Vector3d(-0.5, 0.3, 1),
                                  Vector3d(0, -0.5, 1), Vector3d(0, 0, 1.8)}) {
      const auto a = moved[c].model.project(place), b = truth[c].model.project(place);
      sum += (*a - *b).squaredNorm();
      ++count;
    }
  }
  return std::sqrt(sum / count);
}

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

TEST_F(SilhouetteRefining, sees_planes_agree_where_the_cameras_stand_right) {
  const std::vector<CameraModel> cameras = models_of(truth_);
  std::vector<Outline> outlines;
  for (size_t c = 0; c < cameras.size(); ++c) {
    outlines.push_back(outline_of(masks_[0][c], cameras[c]));
  }
  const std::vector<Tangent> tangents = tangents_of(cameras, outlines);
  ASSERT_GT(tangents.size(), 20U);
  int close = 0;
  for (const Tangent& t : tangents) {
    const double angle = angle_between(t, cameras[t.a], cameras[t.b]);
    close += std::abs(angle) * t.px_per_radian() < 1;
  }
  EXPECT_GT(close, 0.8 * static_cast<double>(tangents.size()));
}

TEST_F(SilhouetteRefining, brings_cameras_that_are_a_pixel_off_nearer_to_their_places) {
  const Rig before = disturbed(truth_, 1, 5);
  const RefineResult result = refine_by_silhouettes(before, sets(), {});
  EXPECT_TRUE(result.better);
  RecordProperty("before", std::to_string(error_px(before, truth_)));
  RecordProperty("after", std::to_string(error_px(result.rig, truth_)));
  EXPECT_LT(error_px(result.rig, truth_), 0.6 * error_px(before, truth_));
}

TEST_F(SilhouetteRefining, leaves_a_rig_alone_that_is_right) {
  const RefineResult result = refine_by_silhouettes(truth_, sets(), {});
  EXPECT_FALSE(result.better);
  EXPECT_LT(error_px(result.rig, truth_), 1e-9);
}

TEST_F(SilhouetteRefining, says_what_is_lacking) {
  std::vector<SilhouetteSet> few = sets();
  few.resize(3);
  EXPECT_THAT(test::message_of<InputError>([&] { refine_by_silhouettes(truth_, few, {}); }),
              HasSubstr("3 instants are too few"));
  const std::vector<SilhouetteSet> none(9, SilhouetteSet(truth_.size(), nullptr));
  EXPECT_THAT(test::message_of<InputError>([&] { refine_by_silhouettes(truth_, none, {}); }),
              HasSubstr("only 0 planes touch"));
}

}  // namespace
}  // namespace v3d::calib
