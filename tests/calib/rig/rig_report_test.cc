#include "calib/rig/rig_report.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/html.h"
#include "calib/rig/advice.h"
#include "sim/scene.h"

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

TEST(Advice, is_silent_where_nothing_is_weak) { EXPECT_THAT(advice(good_fit()), IsEmpty()); }

TEST(Advice, tells_between_which_cameras_to_show_the_board) {
  RigFit fit = good_fit();
  for (PairPose& pair : fit.pairs) {
    if (pair.b == 3) pair.agreeing = 2;
  }
  EXPECT_THAT(advice(fit),
              Contains(HasSubstr("cam04 shares 6 views with its neighbours: show the board between "
                                 "cam04 and cam0")));
}

TEST(Advice, tells_where_in_the_image_boards_are_missing) {
  RigFit fit = good_fit();
  fit.cameras[1].coverage = 0.3;
  std::erase_if(fit.cameras[1].residuals,
                [](const CornerResidual& r) { return r.pixel.x() > 680 && r.pixel.y() > 510; });
  EXPECT_THAT(advice(fit), Contains(HasSubstr("cam02: boards reached 30 % of its image: show the "
                                              "board in the lower right part")));
}

TEST(Advice, names_cameras_that_fit_worse_and_cameras_that_are_late) {
  RigFit fit = good_fit();
  fit.cameras[2].rms_px = 0.9;
  fit.cameras[0].late = -0.4;
  EXPECT_THAT(advice(fit),
              Contains(HasSubstr("cam03 misses by 0.90 px, the median camera by 0.30")));
  EXPECT_THAT(advice(fit), Contains(HasSubstr("cam01 is 0.40 pictures early")));
}

TEST(Report, is_one_page_with_a_picture_of_every_camera_and_no_link_to_elsewhere) {
  RigFit fit = good_fit();
  fit.rejected.push_back({1, 12, "blurred & <dark>"});
  const std::string html =
      report_html(parse_board("chess:9x6:25mm"), fit, {data_url({1, 2, 3, 4}), "", "", ""});
  for (const RigCamera& camera : fit.rig)
    EXPECT_THAT(html, HasSubstr("<b>" + camera.name + "</b>"));
  EXPECT_THAT(html, HasSubstr("data:image/jpeg;base64,AQIDBA=="));
  EXPECT_THAT(html, HasSubstr("blurred &amp; &lt;dark>"));
  EXPECT_THAT(html, HasSubstr("Nothing is weak."));
  EXPECT_THAT(html, Not(HasSubstr("http")));
}

}  // namespace
}  // namespace v3d::calib
