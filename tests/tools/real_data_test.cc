// Tests of the whole pipeline, from import to evaluation, on real recordings.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <string>

#include "base/core/statistics.h"
#include "base/geometry/mesh.h"
#include "base/geometry/rigid_transform.h"
#include "daemon/recorded/mesh_frames.h"
#include "real_recordings.h"
#include "support/temporary_folder.h"
#include "v3dctl/evaluate/evaluate.h"
#include "v3dctl/import/import.h"
#include "v3dctl/reconstruct/take_reconstruction.h"

namespace v3d::ctl {
namespace {

namespace fs = std::filesystem;

class RealData : public test::RealRecordings {
 protected:
  void SetUp() override {
    RealRecordings::SetUp();
    import_.take = request_.take = folder_ / "take";
    request_.threads = 2;
  }

  static double least(const std::vector<double>& values) {
    return *std::min_element(values.begin(), values.end());
  }

  test::TemporaryFolder folder_;
  ImportOptions import_;
  ReconstructRequest request_;
};

TEST_F(RealData, studio20_gives_one_closed_mesh_that_covers_the_silhouettes) {
  import_.calib = data_ / "studio20/calib.toml";
  import_.images = data_ / "studio20/images";
  import_.masks = data_ / "studio20/masks";
  EXPECT_EQ(import_take(import_).cameras.size(), 20U);
  request_.bounds = parse_bounds("-0.6,-0.6,-0.1,0.6,0.6,1.9");
  request_.voxel_m = 0.008;
  const ReconstructReport report = reconstruct_take(request_);
  EXPECT_GT(report.volume_m3.at(0), 0.066);
  EXPECT_LT(report.volume_m3.at(0), 0.078);
  EXPECT_GE(mean(report.silhouette_iou), 0.94);
  EXPECT_GE(least(report.silhouette_iou), 0.92);
  const Mesh mesh = recorded::MeshFrames(request_.take).read(0).mesh;
  EXPECT_TRUE(is_watertight(mesh));
  EXPECT_EQ(connected_components(mesh), 1);
}

TEST_F(RealData, studio20_resembles_the_image_of_a_held_out_camera) {
  import_.calib = data_ / "studio20/calib.toml";
  import_.images = data_ / "studio20/images";
  import_.masks = data_ / "studio20/masks";
  import_take(import_);
  request_.bounds = parse_bounds("-0.6,-0.6,-0.1,0.6,0.6,1.9");
  request_.leave_out = {"cam05"};
  reconstruct_take(request_);
  const HeldOutReport report = evaluate_held_out({request_.take}, {{"cam05"}}).at(0);
  EXPECT_GT(report.iou, 0.9);
  EXPECT_GT(report.inside.psnr_db, 15);
}

class Room4 : public RealData {
 protected:
  void SetUp() override {
    RealData::SetUp();
    import_.calib = data_ / "room4/calib.toml";
    for (const char* camera : {"cam1", "cam2", "cam3", "cam4"}) {
      import_.videos.emplace_back(camera, data_ / "room4" / camera / "video.avi");
      import_.backgrounds.emplace_back(camera, data_ / "room4" / camera / "background.avi");
    }
    request_.voxel_m = 0.02;
  }

  ReconstructReport rebuild(take::FrameRange frames) {
    import_.take = request_.take = folder_ / ("take-" + std::to_string(frames.begin));
    import_.frames = frames;
    import_take(import_);
    return reconstruct_take(request_);
  }
};

TEST_F(Room4, is_segmented_by_its_own_plates_and_reconstructed) {
  const ReconstructReport report = rebuild({195, 205});
  EXPECT_EQ(report.frames, 10);
  EXPECT_EQ(report.incomplete, 0);
  EXPECT_GT(least(report.vertices), 1000);
  // Measured in the common view of the cameras: 0.896. The board, put up after the plates in view
  // of cam3 alone, is included.
  EXPECT_GT(mean(report.silhouette_iou), 0.88);
}

// The README of the data reports 0.86 to 0.93 per camera with another background subtraction.
// Measured here over all 426 frames: 0.901 (cam3, whose calibrated pose is wrong by one degree) to
// 0.956 per camera, mean 0.937, minimum of any frame and camera 0.898.
TEST_F(Room4, fills_the_silhouettes_of_the_seated_man_from_the_first_frame_to_the_last) {
  request_.bounds = parse_bounds("-1.5,-1.5,-0.5,1.5,1.5,2.5");
  for (const int64_t begin : {0, 140, 280, 421}) {
    const ReconstructReport report = rebuild({begin, begin + 5});
    for (size_t i = 0; i < report.cameras.size(); ++i) {
      EXPECT_GE(least(report.camera_iou[i]), 0.86) << report.cameras[i] << " from " << begin;
    }
    EXPECT_GE(mean(report.silhouette_iou), 0.92) << "from " << begin;
  }
}

TEST_F(RealData, dino16_is_segmented_from_its_black_background_and_reconstructed) {
  import_.calib = data_ / "dino16/calib.toml";
  import_.images = data_ / "dino16";
  import_.black = parse_black_background("0.19:10:7");
  EXPECT_EQ(import_take(import_).cameras.size(), 16U);
  request_.bounds = parse_bounds("-0.061897,-0.018874,-0.057845,0.010897,0.068227,0.015495");
  request_.voxel_m = 0.001;
  request_.leave_out = {"dinoSR0006"};  // its README reports a bad silhouette
  const ReconstructReport report = reconstruct_take(request_);
  EXPECT_GT(mean(report.silhouette_iou), 0.9);
  EXPECT_GT(least(report.silhouette_iou), 0.85);
}

}  // namespace
}  // namespace v3d::ctl
