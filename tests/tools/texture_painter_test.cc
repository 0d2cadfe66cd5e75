#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>

#include "base/config/calib_file.h"
#include "base/image/image_files.h"
#include "daemon/recorded/mesh_frames.h"
#include "support/temporary_folder.h"
#include "tools/test_images.h"
#include "v3dctl/export/mesh_export.h"
#include "v3dctl/import/import.h"
#include "v3dctl/reconstruct/take_reconstruction.h"

namespace v3d::ctl {
namespace {

namespace fs = std::filesystem;

Image red_image(const RigCamera& camera) {
  Image image(camera.model.size(), PixelFormat::kRGB8);
  for (int y = 0; y < image.size.height; ++y) {
    for (int x = 0; x < image.size.width; ++x) image.row(y)[3 * x] = 255;
  }
  return image;
}

/// Texels with far more red than the ball has.
int64_t red_texels(const Image& atlas) {
  int64_t count = 0;
  for (int y = 0; y < atlas.size.height; ++y) {
    const uint8_t* rgb = atlas.row(y);
    for (int x = 0; x < atlas.size.width; ++x, rgb += 3) {
      if (rgb[0] > 2 * (rgb[1] + rgb[2])) ++count;
    }
  }
  return count;
}

/// A take of two pulses of a ball. At pulse 1, and at both in the last camera, images are red.
class TexturedTake : public testing::Test {
 protected:
  TexturedTake() {
    const Rig rig = test::small_rig(kCameras);
    save_calib(folder_ / "calib.toml", rig);
    for (const RigCamera& camera : rig) {
      const bool last = camera.name == rig.back().name;
      write("images", camera, "0.png", last ? red_image(camera) : test::ball_image(camera));
      write("images", camera, "1.png", red_image(camera));
      write("masks", camera, "0.png", test::ball_mask(camera));
      write("masks", camera, "1.png", test::ball_mask(camera));
    }
    ImportOptions import;
    import.take = request_.take = folder_ / "take";
    import.calib = folder_ / "calib.toml";
    import.images = folder_ / "images";
    import.masks = folder_ / "masks";
    import_take(import);
    request_.bounds = Box{{-0.5, -0.5, -0.5}, {0.5, 0.5, 0.5}};
    request_.voxel_m = 0.02;
    request_.threads = 2;
  }

  void write(const char* kind, const RigCamera& camera, const char* name, const Image& image) {
    const fs::path folder = folder_ / kind / camera.name;
    fs::create_directories(folder);
    write_png(folder / name, image.view());
  }

  /// Red texels of the atlas of pulse 0.
  int64_t red_texels_of_pulse_0() {
    reconstruct_take(request_);
    const Mesh mesh = recorded::MeshFrames(request_.take).read(0).mesh;
    TexturePainter painter(request_.take, "--atlas");
    const Image atlas = painter.paint(mesh, painter.layout_of(mesh, 256), 0).image;
    EXPECT_EQ(painter.incomplete(), 0);
    return red_texels(atlas);
  }

  static constexpr int kCameras = 8;
  const test::TemporaryFolder folder_;
  ReconstructRequest request_;
};

TEST_F(TexturedTake, has_no_texel_of_a_camera_that_the_reconstruction_left_out) {
  EXPECT_GT(red_texels_of_pulse_0(), 100);
  request_.leave_out = {"h"};
  EXPECT_EQ(red_texels_of_pulse_0(), 0);
}

TEST_F(TexturedTake, names_the_cameras_of_its_meshes_and_all_cameras_at_other_pulses) {
  request_.leave_out = {"c"};
  request_.frames = {0, 1};
  reconstruct_take(request_);
  recorded::MeshCameras cameras({request_.take});
  EXPECT_THAT(cameras.at(0).names, testing::ElementsAre("a", "b", "d", "e", "f", "g", "h"));
  EXPECT_EQ(cameras.at(1).names.size(), kCameras);
  fs::remove(take::TakePaths{request_.take}.mesh());
  EXPECT_EQ(recorded::MeshCameras({request_.take}).at(0).names.size(), kCameras);
}

TEST_F(TexturedTake, has_the_next_image_of_a_late_camera_and_none_of_an_unused_one) {
  recorded::TakeFrames take(request_.take, {});
  const auto frames = read_used({.pulse = 0, .names = {"a", "b"}, .late = {"b"}}, take);
  ASSERT_EQ(frames.size(), kCameras);
  EXPECT_EQ(frames[0].value().raw.label.pulse, 0);
  EXPECT_EQ(frames[1].value().raw.label.pulse, 1);
  EXPECT_TRUE(std::none_of(frames.begin() + 2, frames.end(),
                           [](const auto& frame) { return frame.has_value(); }));
}

}  // namespace
}  // namespace v3d::ctl
