#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <functional>

#include "base/config/calib_file.h"
#include "base/image/image_files.h"
#include "daemon/recorded/mesh_frames.h"
#include "recon/shapes.h"
#include "support/temporary_folder.h"
#include "tools/test_images.h"
#include "v3dctl/export/mesh_export.h"
#include "v3dctl/import/import.h"
#include "v3dctl/reconstruct/take_reconstruction.h"
#include "v3dctl/skeleton/take_skeleton.h"

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

/// A take of two pulses of a ball.
class BallTake : public testing::Test {
 protected:
  /// `draw`: returns the image of a camera at a pulse.
  explicit BallTake(const std::function<Image(const RigCamera&, int)>& draw) {
    const Rig rig = test::small_rig(kCameras);
    save_calib(folder_ / "calib.toml", rig);
    for (const RigCamera& camera : rig) {
      for (const int pulse : {0, 1}) {
        const std::string name = std::to_string(pulse) + ".png";
        write("images", camera, name, draw(camera, pulse));
        write("masks", camera, name, test::ball_mask(camera));
      }
    }
    ImportOptions import;
    import.take = take_;
    import.calib = folder_ / "calib.toml";
    import.images = folder_ / "images";
    import.masks = folder_ / "masks";
    import_take(import);
  }

  static constexpr int kCameras = 8;
  const test::TemporaryFolder folder_;
  const fs::path take_ = folder_ / "take";

 private:
  void write(const char* kind, const RigCamera& camera, const std::string& name,
             const Image& image) {
    const fs::path folder = folder_ / kind / camera.name;
    fs::create_directories(folder);
    write_png(folder / name, image.view());
  }
};

/// At pulse 1, and at both in the last camera, images are red.
class TexturedTake : public BallTake {
 protected:
  TexturedTake()
      : BallTake([](const RigCamera& camera, int pulse) {
          const bool is_last = camera.name == test::small_rig(kCameras).back().name;
          return is_last || pulse == 1 ? red_image(camera) : test::ball_image(camera);
        }) {
    request_.take = take_;
    request_.bounds = Box{{-0.5, -0.5, -0.5}, {0.5, 0.5, 0.5}};
    request_.voxel_m = 0.02;
    request_.threads = 2;
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

/// The ball is brighter at pulse 0, by 10 grey values. Its tracked surface is at rest at pulse 1.
class SkinTexture : public BallTake {
 protected:
  SkinTexture()
      : BallTake([](const RigCamera& camera, int pulse) {
          Image image = test::ball_image(camera);
          for (uint8_t& value : image.bytes) {
            if (value > 0 && pulse == 0) value = static_cast<uint8_t>(value + 10);
          }
          return image;
        }) {
    recon::TrackedBody& body = skeleton_.tracked.emplace_back();
    body.surface = recon::shapes::sphere({0, 0, 0}, 0.3F, 24);
    body.rest = 1;
    body.pulses = {0, 1};
    body.positions.assign(2, body.surface.vertices);
    body.colours.resize(2);
    skeleton_.skins.emplace_back().influences.resize(body.surface.vertices.size());
  }

  recon::TextureAtlas texture() { return skin_textures(skeleton_, painter_, 256).at(0); }
  /// The colours at a pulse alone.
  recon::AtlasColours colours_at(size_t n, const recon::AtlasLayout& layout) {
    Mesh surface = skeleton_.tracked[0].surface;
    surface.vertices = skeleton_.tracked[0].positions[n];
    return painter_.paint(surface, layout, skeleton_.tracked[0].pulses[n]);
  }

  TakeSkeleton skeleton_;
  TexturePainter painter_{take_, "--atlas"};
};

/// The numbers of texels that a camera sees in one image and not in the other.
std::vector<size_t> seen_only_in(const recon::AtlasColours& one, const recon::AtlasColours& other) {
  std::vector<size_t> texels;
  for (size_t i = 0; i < one.seen.size(); ++i) {
    if (one.seen[i] != 0 && other.seen[i] == 0) texels.push_back(i);
  }
  return texels;
}

testing::AssertionResult are_equal(const Image& a, const Image& b,
                                   const std::vector<size_t>& texels) {
  for (const size_t i : texels) {
    for (size_t c = 3 * i; c < 3 * i + 3; ++c) {
      if (a.bytes[c] == b.bytes[c]) continue;
      return testing::AssertionFailure() << "texel " << i << ": " << static_cast<int>(a.bytes[c])
                                         << ", not " << static_cast<int>(b.bytes[c]);
    }
  }
  return testing::AssertionSuccess();
}

TEST_F(SkinTexture, has_the_colours_at_the_rest_pulse_where_a_camera_sees_the_surface_then) {
  const recon::TextureAtlas atlas = texture();
  const recon::AtlasColours rest = colours_at(1, atlas.layout);
  std::vector<size_t> seen;
  for (size_t i = 0; i < rest.seen.size(); ++i) {
    if (rest.seen[i] != 0) seen.push_back(i);
  }
  EXPECT_GT(seen.size(), 5'000U);
  EXPECT_TRUE(are_equal(atlas.image, rest.image, seen));
}

TEST_F(SkinTexture, has_the_colours_of_another_pulse_where_no_camera_sees_the_surface_at_rest) {
  // No camera sees the poles of the ball at rest. At pulse 0 it lies on its side.
  for (Eigen::Vector3f& p : skeleton_.tracked[0].positions[0]) p = {p.x(), -p.z(), p.y()};
  const recon::TextureAtlas atlas = texture();
  const recon::AtlasColours other = colours_at(0, atlas.layout);
  const std::vector<size_t> poles = seen_only_in(other, colours_at(1, atlas.layout));
  EXPECT_GT(poles.size(), 10U);
  EXPECT_TRUE(are_equal(atlas.image, other.image, poles));
}

}  // namespace
}  // namespace v3d::ctl
