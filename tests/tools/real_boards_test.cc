// Tests of the calibration of real cameras (results: docs/calibration.md).
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <toml++/toml.h>

#include <algorithm>
#include <opencv2/calib3d.hpp>

#include "base/config/calib_file.h"
#include "calib/boards/board.h"
#include "calib/lens/bundle_adjustment.h"
#include "calib/lens/lens_fit.h"
#include "calib/rig/pair_poses.h"
#include "calib/rig/rig_alignment.h"
#include "calib/rig/rig_fit.h"
#include "calibrate/rig_boards.h"
#include "real_recordings.h"

namespace v3d::calibrate {
namespace {

namespace fs = std::filesystem;

constexpr double kDegree = 3.14159265 / 180;

class RealBoards : public test::RealRecordings {};

/// RMS reprojection error, over both images, of OpenCV's calibration of the same corners, pixels.
double opencv_stereo_rms(const calib::Board& board, const RigBoards& boards) {
  std::vector<std::vector<cv::Point3f>> corners;
  std::vector<std::vector<cv::Point2f>> pixels[2];
  const auto points_of = [](const calib::BoardObservation& observation) {
    std::vector<cv::Point2f> points;
    for (const auto& p : observation.pixels) points.emplace_back(p.x(), p.y());
    return points;
  };
  const auto& left = boards.cameras[0].observations;
  const auto& right = boards.cameras[1].observations;
  for (const auto& [instant, observation] : left) {
    if (!right.contains(instant)) continue;
    pixels[0].push_back(points_of(observation));
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
  // RMS of the distance over the corners of both images, as in RigFit::rms_px.
  return cv::stereoCalibrate(corners, pixels[0], pixels[1], k[0], d[0], k[1], d[1], size, r, t, e,
                             f, cv::CALIB_USE_INTRINSIC_GUESS);
}

TEST_F(RealBoards, of_a_stereo_pair_have_the_reprojection_error_of_OpenCV) {
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

/// A camera of caliscope's camera_array.toml. `error` is the result of cv::calibrateCamera for its
/// lens alone, over grid_count pictures.
struct CaliscopeCamera {
  CameraModel model;
  double error_px = 0;
};

std::vector<CaliscopeCamera> load_camera_array(const fs::path& file) {
  std::vector<CaliscopeCamera> cameras;
  const toml::table text = toml::parse_file(file.string());
  for (const RigCamera& camera : load_calib(file)) {
    const std::string number = camera.name.substr(camera.name.find('_') + 1);
    cameras.push_back({camera.model, *text["cameras"][number]["error"].value<double>()});
  }
  return cameras;
}

/// RMS reprojection error of a calibration with optimal board poses, over every instant that two or
/// more cameras saw, pixels.
double rms_of_rig(const calib::Board& board, const std::vector<CaliscopeCamera>& rig,
                  const std::vector<calib::CameraObservations>& seen) {
  std::vector<CameraModel> cameras;
  std::vector<calib::CandidatePoses> poses;
  calib::BundleOptions options{.fixed_cameras = {}};
  for (size_t c = 0; c < rig.size(); ++c) {
    cameras.push_back(rig[c].model);
    poses.push_back(calib::candidate_poses(rig[c].model, board, seen[c]));
    options.fixed_cameras.push_back(static_cast<int>(c));
  }
  const auto pairs = calib::pair_poses(poses);
  calib::Bundle bundle =
      calib::initialize_boards({board, seen, poses, pairs}, cameras, 1000).bundle;
  adjust(bundle, options);
  return calib::rms_of(residuals(bundle));
}

/// The fit of one lens alone, with optimal board poses.
calib::LensFit fit_of_lens(const calib::Board& board, const calib::CameraObservations& camera) {
  std::vector<calib::LensView> views;
  for (const auto& [instant, observation] : camera.observations) {
    views.push_back({std::to_string(instant), observation});
  }
  return fit_lens(camera.name, board, camera.size, views, {});
}

/// The RMS error of the best lens model in held-out images, pixels.
double held_out_rms(const calib::LensFit& fit) {
  return std::ranges::min(fit.trials, {}, &calib::LensTrial::held_out_rms_px).held_out_rms_px;
}

TEST_F(RealBoards, of_each_camera_of_a_pair_have_corners_within_0_18_px_of_its_lens_model) {
  RigSources sources;
  for (const std::string side : {"left", "right"}) {
    sources.images.emplace_back(side, data_ / "stereo_boards" / (side + "[0-9]*.jpg"));
  }
  const calib::BoardDetector detector(calib::parse_board("chess:9x6:25mm"));
  for (const auto& camera : find_rig_boards(sources, detector).cameras) {
    ASSERT_EQ(camera.observations.size(), 13U);
    const calib::LensFit fit = fit_of_lens(detector.board(), camera);
    RecordProperty(camera.name, std::to_string(fit.rms_px));
    RecordProperty(camera.name + "_held_out", std::to_string(held_out_rms(fit)));
    EXPECT_LT(fit.rms_px, 0.18) << camera.name;
    EXPECT_LT(held_out_rms(fit), 0.2) << camera.name;
  }
}

// One of the four free-running webcams delivers its pictures one frame late; caliscope does not
// model this.
TEST_F(RealBoards, of_four_webcams_show_a_late_camera_and_have_a_lower_error_than_caliscope) {
  RigSources sources;
  const fs::path folder = data_ / "charuco4";
  for (const char* c : {"cam_0", "cam_1", "cam_2", "cam_3"}) {
    sources.videos.emplace_back(c, folder / (std::string(c) + ".mp4"));
  }
  sources.time_stamps = folder / "timestamps.csv";
  const calib::BoardDetector detector(
      calib::parse_board("charuco:4x5:54mm:40.5mm:DICT_4X4_1000:inverted"));
  const RigBoards boards = find_rig_boards(sources, detector);
  const std::vector<CaliscopeCamera> theirs = load_camera_array(folder / "camera_array.toml");
  ASSERT_EQ(theirs.size(), 4U);
  for (size_t c = 0; c < theirs.size(); ++c) {
    const calib::LensFit lens = fit_of_lens(detector.board(), boards.cameras[c]);
    RecordProperty(boards.cameras[c].name, std::to_string(lens.rms_px));
    RecordProperty(boards.cameras[c].name + "_held_out", std::to_string(held_out_rms(lens)));
    EXPECT_LE(lens.rms_px, theirs[c].error_px / 1.5);
  }
  const calib::RigFit fit = fit_rig(detector.board(), boards.cameras, {});
  RecordProperty("rig", std::to_string(fit.rms_px));
  EXPECT_NEAR(fit.cameras[1].time_offset, 1, 0.1);
  EXPECT_LT(fit.rms_px, 0.65);
  EXPECT_LT(2 * fit.rms_px, rms_of_rig(detector.board(), theirs, boards.cameras));
  const double apart = (fit.rig[0].model.center() - fit.rig[2].model.center()).norm();
  EXPECT_NEAR(apart, 0.5496, 0.03 * 0.5496) << "halves of the recording differ by up to 2 %";
}

TEST_F(RealBoards, on_the_floor_are_detected_in_all_four_cameras) {
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
  // The calibration in the folder is no better. Each camera alone gives the board's plane to 0.1
  // degrees, but two cameras disagree by 4.5 degrees.
  RecordProperty("floor", std::to_string(fit.rms_px));
  EXPECT_LT(fit.rms_px, 1.6);
  EXPECT_GT(fit.disagreement_deg, 4);
  const RigidTransform old_from_new = fit.new_from_old.rigid.inverse();
  const double height = old_from_new.translation.z() / fit.new_from_old.scale;
  RecordProperty("height_m", std::to_string(height));
  RecordProperty("lean_deg", std::to_string(std::acos(old_from_new.rotation(2, 2)) / kDegree));
  EXPECT_NEAR(height, 0, 0.002);
  EXPECT_GT(old_from_new.rotation(2, 2), std::cos(1.5 * kDegree));
}

}  // namespace
}  // namespace v3d::calibrate
