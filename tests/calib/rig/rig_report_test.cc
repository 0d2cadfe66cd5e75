#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/core/text.h"
#include "calib/rig/reports.h"
#include "sim/rendering/scene.h"

namespace v3d::calib {
namespace {

using testing::Contains;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;

/// Four cameras that are well connected and well covered.
RigFit good_fit() {
  RigFit fit;
  fit.rig = sim::make_rig(4, {1024, 768}, 3);
  fit.rms_px = 0.3;
  for (int i = 0; i < 4; ++i) {
    CameraFit camera{.rms_px = 0.3, .views = 40, .found = 41, .coefficients = 5, .coverage = 0.8};
    for (int y = 20; y < 768; y += 60) {
      for (int x = 20; x < 1024; x += 60) camera.residuals.push_back({{x, y}, {0.2, -0.1}});
    }
    fit.cameras.push_back(camera);
    for (int j = 0; j < i; ++j) fit.pairs.push_back({j, i, {}, 30, 29, 0.002});
  }
  for (int i = 1; i < 4; ++i) fit.tree.edges.push_back({i - 1, i, {}, 29});
  return fit;
}

TEST(Weaknesses, are_none_for_a_good_rig) { EXPECT_THAT(find_weaknesses(good_fit()), IsEmpty()); }

TEST(Weaknesses, name_the_cameras_that_share_too_few_views) {
  RigFit fit = good_fit();
  for (PairPose& pair : fit.pairs) {
    if (pair.b == 3) pair.inliers = 2;
  }
  EXPECT_THAT(find_weaknesses(fit),
              Contains(HasSubstr("cam04 shares 6 views with its neighbours: show the board between "
                                 "cam04 and cam0")));
}

TEST(Weaknesses, name_the_part_of_the_image_without_boards) {
  RigFit fit = good_fit();
  fit.cameras[1].coverage = 0.3;
  std::erase_if(fit.cameras[1].residuals,
                [](const CornerResidual& r) { return r.pixel.x() > 680 && r.pixel.y() > 510; });
  EXPECT_THAT(find_weaknesses(fit),
              Contains(HasSubstr("cam02: boards covered 30 % of its image: show the "
                                 "board in the lower right part")));
}

TEST(Weaknesses, name_cameras_with_large_residuals_and_time_offsets) {
  RigFit fit = good_fit();
  fit.cameras[2].rms_px = 0.9;
  fit.cameras[0].time_offset = -0.4;
  EXPECT_THAT(
      find_weaknesses(fit),
      Contains(HasSubstr("cam03 has an RMS residual of 0.90 px, the median camera 0.30 px")));
  EXPECT_THAT(find_weaknesses(fit), Contains(HasSubstr("cam01 is 0.40 images early")));
}

TEST(Weaknesses, name_a_large_residual_that_all_cameras_have) {
  RigFit fit = good_fit();
  for (CameraFit& camera : fit.cameras) camera.rms_px = 6;
  EXPECT_THAT(find_weaknesses(fit),
              testing::ElementsAre(testing::AllOf(
                  HasSubstr("the median camera has an RMS residual of 6.0 px"),
                  HasSubstr("is the board flat"), Not(HasSubstr("previous calibration")))));
  for (CameraFit& camera : fit.cameras) camera.coefficients = 0;
  EXPECT_THAT(
      find_weaknesses(fit),
      testing::ElementsAre(HasSubstr("Do the lenses of the previous calibration still fit")));
}

TEST(Weaknesses, name_the_worse_one_of_two_cameras) {
  RigFit fit = good_fit();
  fit.rig.resize(2);
  fit.cameras.resize(2);
  std::erase_if(fit.pairs, [](const PairPose& pair) { return pair.b > 1; });
  fit.cameras[0].rms_px = 0.2;
  fit.cameras[1].rms_px = 5;
  EXPECT_THAT(find_weaknesses(fit),
              testing::ElementsAre(HasSubstr("cam02 has an RMS residual of 5.00 px")));
}

TEST(Weaknesses, name_cameras_whose_boards_were_hardly_tilted) {
  RigFit fit = good_fit();
  fit.cameras[1].focal_deviation = 0.023;
  EXPECT_THAT(
      find_weaknesses(fit),
      testing::ElementsAre("cam02: its own boards determine its focal length only to 2.3 % (1 "
                           "sigma): tilt the board by 30 degrees and more in all directions"));
}

TEST(RigReport, is_one_page_with_an_image_of_every_camera_and_no_external_link) {
  RigFit fit = good_fit();
  fit.rejected.push_back({1, 12, "blurred & <dark>"});
  const std::string image = "data:image/jpeg;base64,AQIDBA==";
  const std::string html = rig_report_html(parse_board("chess:9x6:25mm"), fit, {image, "", "", ""});
  for (const RigCamera& camera : fit.rig)
    EXPECT_THAT(html, HasSubstr("<b>" + camera.name + "</b>"));
  EXPECT_THAT(html, HasSubstr(image));
  EXPECT_THAT(html, HasSubstr("blurred &amp; &lt;dark>"));
  EXPECT_THAT(html, HasSubstr("No weaknesses."));
  EXPECT_THAT(html, Not(HasSubstr("http")));
}

}  // namespace
}  // namespace v3d::calib
