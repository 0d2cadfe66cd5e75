// Calibration of real cameras. The recordings lie outside the repository: in $V3D_DATA, else in
// ../shared/data beside it.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdlib>
#include <opencv2/calib3d.hpp>

#include "base/calib_file.h"
#include "calib/floor.h"
#include "calib/rig_fit.h"
#include "calibrate/floor_boards.h"
#include "calibrate/rig_boards.h"

namespace v3d::calibrate {
namespace {

namespace fs = std::filesystem;

class RealBoards : public testing::Test {
 protected:
  void SetUp() override {
    const char* variable = std::getenv("V3D_DATA");
    data_ = variable ? fs::path(variable) : fs::path(V3D_SOURCE_DIR) / "../shared/data";
    if (!fs::exists(data_ / "stereo_boards")) {
      GTEST_SKIP() << "no real data: neither $V3D_DATA nor ../shared/data holds stereo_boards";
    }
  }
  fs::path data_;
};

/// Root mean square over both images of OpenCV's own calibration of the same corners.
double opencv_stereo_rms(const calib::Board& board, const RigBoards& boards) {
  std::vector<std::vector<cv::Point3f>> corners;
  std::vector<std::vector<cv::Point2f>> pixels[2];
  const auto points_of = [](const calib::BoardSighting& sighting) {
    std::vector<cv::Point2f> points;
    for (const auto& p : sighting.pixels) points.emplace_back(p.x(), p.y());
    return points;
  };
  const auto& left = boards.cameras[0].sightings;
  const auto& right = boards.cameras[1].sightings;
  for (const auto& [instant, sighting] : left) {
    if (!right.contains(instant)) continue;
    pixels[0].push_back(points_of(sighting));
    pixels[1].push_back(points_of(right.at(instant)));
    std::vector<cv::Point3f> view;
    for (int i = 0; i < board.corners(); ++i) {
      const Eigen::Vector3d c = board.corner(i);
      view.emplace_back(c.x(), c.y(), 0);
    }
    corners.push_back(view);
  }
  const cv::Size size(boards.cameras[0].size.width, boards.cameras[0].size.height);
  cv::Mat k[2], d[2], r, t, e, f;
  std::vector<cv::Mat> rotations, translations;
  for (int i = 0; i < 2; ++i) {
    cv::calibrateCamera(corners, pixels[i], size, k[i], d[i], rotations, translations);
  }
  // Of the distance, over the corners of both images, as ours is.
  return cv::stereoCalibrate(corners, pixels[0], pixels[1], k[0], d[0], k[1], d[1], size, r, t, e,
                             f, cv::CALIB_USE_INTRINSIC_GUESS);
}

TEST_F(RealBoards, of_a_stereo_pair_fit_as_well_as_OpenCV_makes_them) {
  RigSources sources;
  for (const std::string side : {"left", "right"}) {
    sources.images.emplace_back(side, data_ / "stereo_boards" / (side + "[0-9]*.jpg"));
  }
  const calib::BoardDetector detector(calib::parse_board("chess:9x6:25mm"));
  const RigBoards boards = find_rig_boards(sources, detector);
  const calib::RigFit fit = fit_rig(detector.board(), boards.cameras, {});
  const double theirs = opencv_stereo_rms(detector.board(), boards);
  RecordProperty("ours", std::to_string(fit.rms_px));
  RecordProperty("theirs", std::to_string(theirs));
  EXPECT_LT(fit.rms_px, theirs + 0.01) << "OpenCV: " << theirs;
}

// One of the four free-running webcams holds its pictures back by one. Another program's result,
// which does not know, is no truth; its distances differ from ours by up to 2.5 %.
TEST_F(RealBoards, in_four_webcams_tell_that_one_is_a_picture_late) {
  RigSources sources;
  const fs::path folder = data_ / "charuco4";
  for (const char* c : {"cam_0", "cam_1", "cam_2", "cam_3"}) {
    sources.videos.emplace_back(c, folder / (std::string(c) + ".mp4"));
  }
  sources.time_stamps = folder / "timestamps.csv";
  const calib::BoardDetector detector(
      calib::parse_board("charuco:4x5:54mm:40.5mm:DICT_4X4_1000:inverted"));
  const RigBoards boards = find_rig_boards(sources, detector);
  const calib::RigFit fit = fit_rig(detector.board(), boards.cameras, {});
  EXPECT_NEAR(fit.cameras[1].late, 1, 0.1);
  EXPECT_LT(fit.rms_px, 0.65);
  const double apart = (fit.rig[0].model.center() - fit.rig[2].model.center()).norm();
  EXPECT_NEAR(apart, 0.5496, 0.03 * 0.5496);
}

TEST_F(RealBoards, on_the_floor_are_found_in_all_four_cameras_however_slanted) {
  RigSources sources;
  const fs::path folder = data_ / "room4";
  for (const char* c : {"cam1", "cam2", "cam3", "cam4"}) {
    sources.videos.emplace_back(c, folder / c / "checkerboard.avi");
  }
  const Rig rig = load_calib(folder / "calib.toml");
  const calib::BoardDetector detector(calib::parse_board("chess:8x6:115mm"));
  const auto seen = find_floor_boards(sources, rig, detector);
  ASSERT_EQ(seen.size(), 4U);
  const calib::FloorFit fit = fit_floor(rig, detector.board(), seen);
  EXPECT_LT(fit.rms_px, 1.6);  // the calibration in the folder is no better
  const RigidTransform old_from_new = fit.new_from_old.rigid.inverse();
  EXPECT_NEAR(old_from_new.translation.z() / fit.new_from_old.scale, 0, 0.002);
  EXPECT_GT(old_from_new.rotation(2, 2), std::cos(1.5 * 3.14159 / 180));
}

}  // namespace
}  // namespace v3d::calibrate
