#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <numbers>
#include <random>

#include "base/config/calib_file.h"
#include "base/core/error.h"
#include "base/image/image_files.h"
#include "base/io/file.h"
#include "calib/formats/rig_text.h"
#include "common/mesh_formats.h"
#include "daemon/recorded/mesh_frames.h"
#include "recon/render/renderer.h"
#include "recon/texture/undistortion.h"
#include "support/message_of.h"
#include "support/small_disk.h"
#include "support/temporary_folder.h"
#include "tools/test_images.h"
#include "v3dctl/export/take_export.h"
#include "v3dctl/import/import.h"
#include "v3dctl/reconstruct/take_reconstruction.h"

namespace v3d::ctl {
namespace {

using recon::MaskedImage;
using recon::pinhole_of;
using recon::undistorted_pixel;
using testing::HasSubstr;
namespace fs = std::filesystem;

/// A lens with all kinds of distortion, skew, and a principal point beside the middle.
CameraModel distorting_camera(ImageSize size, double focal, const RigidTransform& pose) {
  Eigen::Matrix3d matrix;
  matrix << focal, 0.3, 0.47 * size.width, 0, 1.01 * focal, 0.54 * size.height, 0, 0, 1;
  return {size, matrix, {-0.21, 0.06, 0.002, -0.001, 0.01}, pose};
}

CameraModel distorting_camera() {
  return distorting_camera({200, 160}, 150, look_at({2, 0.3, 1}, {0, 0, 0.1}));
}

/// Red is the column of a pixel, green its row.
MaskedImage coordinates(ImageSize size) {
  MaskedImage picture{Image(size, PixelFormat::kRGB8), Mask(size)};
  for (int y = 0; y < size.height; ++y) {
    for (int x = 0; x < size.width; ++x) {
      uint8_t* const rgb = picture.image.row(y) + static_cast<size_t>(3) * x;
      rgb[0] = static_cast<uint8_t>(x);
      rgb[1] = static_cast<uint8_t>(y);
      if (x >= size.width / 2) picture.mask.set(x, y);
    }
  }
  return picture;
}

TEST(Undistortion, has_the_principal_point_in_the_middle_of_an_image_that_holds_the_whole_one) {
  const CameraModel camera = distorting_camera();
  const CameraModel pinhole = pinhole_of(camera, "cam01");
  EXPECT_FALSE(pinhole.has_distortion());
  EXPECT_EQ(pinhole.matrix()(0, 0), camera.matrix()(0, 0));
  EXPECT_EQ(pinhole.matrix()(1, 1), camera.matrix()(1, 1));
  EXPECT_EQ(pinhole.matrix()(0, 1), 0);
  const ImageSize size = pinhole.size();
  EXPECT_EQ(pinhole.matrix()(0, 2), (size.width - 1) / 2.0);
  EXPECT_EQ(pinhole.matrix()(1, 2), (size.height - 1) / 2.0);
  EXPECT_GE(pinhole.matrix()(0, 2), camera.matrix()(0, 2));
  EXPECT_GE(size.width - pinhole.matrix()(0, 2), camera.size().width - camera.matrix()(0, 2));
  EXPECT_LE(size.width, 214);
  EXPECT_LE(size.height, 175);
}

TEST(Undistortion, copies_the_image_of_a_lens_without_distortion) {
  Eigen::Matrix3d matrix;
  matrix << 150, 0, 90, 0, 150, 79.5, 0, 0, 1;
  const CameraModel camera({200, 160}, matrix, {}, {});
  const CameraModel pinhole = pinhole_of(camera, "cam01");
  ASSERT_EQ(pinhole.size(), (ImageSize{219, 160}));
  const MaskedImage picture = undistorted(coordinates(camera.size()), camera, pinhole);
  const int shift = 19;
  for (int y = 0; y < 160; ++y) {
    for (int x = 0; x < 200; ++x) {
      const uint8_t* const rgb = picture.image.row(y) + static_cast<size_t>(3) * (x + shift);
      ASSERT_EQ(rgb[0], x);
      ASSERT_EQ(rgb[1], y);
      ASSERT_EQ(picture.mask.get(x + shift, y), x >= 100);
    }
    ASSERT_EQ(picture.image.row(y)[3 * (shift - 1) + 1], 0)
        << "the camera does not see this column";
    ASSERT_FALSE(picture.mask.get(shift - 1, y));
  }
}

TEST(Undistortion, shows_at_the_pixel_of_a_ray_what_the_camera_sees_along_it) {
  const CameraModel camera = distorting_camera();
  const CameraModel pinhole = pinhole_of(camera, "cam01");
  const MaskedImage picture = undistorted(coordinates(camera.size()), camera, pinhole);
  std::mt19937 random(5);
  std::uniform_int_distribution<int> column(15, pinhole.size().width - 16);
  std::uniform_int_distribution<int> row(15, pinhole.size().height - 16);
  for (int n = 0; n < 500; ++n) {
    const int x = column(random), y = row(random);
    const auto ray = pinhole.ray({x, y});
    const auto pixel = camera.project(camera.center() + 3 * *ray);
    ASSERT_TRUE(pixel);
    const uint8_t* const rgb = picture.image.row(y) + static_cast<size_t>(3) * x;
    EXPECT_NEAR(rgb[0], pixel->x(), 0.51);
    EXPECT_NEAR(rgb[1], pixel->y(), 0.51);
    EXPECT_EQ(picture.mask.get(x, y), std::floor(pixel->x() + 0.5) >= 100);
  }
}

TEST(Undistortion, of_a_point_is_where_the_pinhole_camera_projects_it) {
  const CameraModel camera = distorting_camera();
  const CameraModel pinhole = pinhole_of(camera, "cam01");
  std::mt19937 random(6);
  std::uniform_real_distribution<double> metres(-0.4, 0.4);
  for (int n = 0; n < 500; ++n) {
    const Eigen::Vector3d world(metres(random), metres(random), metres(random));
    const auto pixel = undistorted_pixel(world, camera, pinhole);
    ASSERT_TRUE(pixel);
    EXPECT_LT((*pixel - *pinhole.project(world)).norm(), 1e-6);
  }
  EXPECT_FALSE(undistorted_pixel({4, 0.3, 1}, camera, pinhole)) << "behind the camera";
}

TEST(Undistortion, rejects_a_principal_point_far_from_the_image) {
  Eigen::Matrix3d matrix;
  matrix << 150, 0, 9000, 0, 150, 80, 0, 0, 1;
  EXPECT_THAT(test::message_of<InputError>([&] {
                pinhole_of(CameraModel({200, 160}, matrix, {}, {}), "cam07");
              }),
              HasSubstr("cam07: its principal point is too far from the image"));
}

/// A take with two pulses of a ball in front of lenses with distortion, reconstructed.
class TrainingExport : public testing::Test {
 protected:
  TrainingExport() {
    for (RigCamera& camera : rig_) {
      camera.model = distorting_camera({64, 48}, 80, camera.model.cam_from_world());
    }
    save_calib(folder_ / "calib.toml", rig_);
    for (const RigCamera& camera : rig_) {
      for (const char* pulse : {"0.png", "1.png"}) {
        write(folder_ / "images" / camera.name / pulse, test::ball_image(camera));
        write(folder_ / "masks" / camera.name / pulse, test::ball_mask(camera));
      }
    }
    ImportOptions import;
    import.take = take_;
    import.calib = folder_ / "calib.toml";
    import.images = folder_ / "images";
    import.masks = folder_ / "masks";
    import_take(import);
    request_.take = take_;
    request_.bounds = Box{{-0.5, -0.5, -0.5}, {0.5, 0.5, 0.5}};
    request_.voxel_m = 0.02;
    request_.threads = 2;
    reconstruct_take(request_);
  }
  static void write(const fs::path& file, const Image& image) {
    fs::create_directories(file.parent_path());
    write_png(file, image.view());
  }
  int exported(TakeFormat format, take::FrameRange frames = {}) {
    return export_take({take_, folder_ / "out", format, frames});
  }
  std::string rejection(TakeFormat format) {
    return test::message_of<InputError>([&] { exported(format); });
  }
  Mesh mesh() { return recorded::MeshFrames(take_).read(0).mesh; }
  Rig written_rig(const fs::path& folder) {
    const fs::path model = folder / "sparse" / "0";
    return calib::parse_colmap({read_file(model / "cameras.txt"), read_file(model / "images.txt")},
                               model);
  }
  std::vector<std::string> leftovers() {
    std::vector<std::string> names;
    for (const auto& entry : fs::directory_iterator(folder_.path())) {
      if (entry.path().string().find("partial") != std::string::npos) names.push_back(entry.path());
    }
    return names;
  }

  const test::TemporaryFolder folder_;
  const fs::path take_ = folder_ / "take";
  Rig rig_ = test::small_rig(6);
  ReconstructRequest request_;
};

TEST_F(TrainingExport, has_one_folder_for_each_pulse_and_none_for_a_single_one) {
  EXPECT_EQ(exported(TakeFormat::kColmap), kExitDone);
  EXPECT_TRUE(fs::exists(folder_ / "out/000001/sparse/0/points3D.txt"));
  EXPECT_TRUE(fs::exists(folder_ / "out/000000/masks/f.png.png"));
  EXPECT_THAT(rejection(TakeFormat::kColmap), HasSubstr("out: is not empty"));
  fs::remove_all(folder_ / "out");
  fs::create_directory(folder_ / "out");
  EXPECT_EQ(exported(TakeFormat::kColmap, {1, 2}), kExitDone);
  EXPECT_TRUE(fs::exists(folder_ / "out/sparse/0/points3D.txt"));
  EXPECT_THAT(leftovers(), testing::IsEmpty());
}

TEST_F(TrainingExport, colmap_cameras_project_a_vertex_where_the_calibration_and_undistortion_do) {
  exported(TakeFormat::kColmap, {0, 1});
  const Rig written = written_rig(folder_ / "out");
  ASSERT_EQ(written.size(), rig_.size());
  for (size_t c = 0; c < rig_.size(); ++c) {
    EXPECT_EQ(written[c].name, rig_[c].name);
    for (const Eigen::Vector3f& vertex : mesh().vertices) {
      const Eigen::Vector3d world = vertex.cast<double>();
      const auto expected = undistorted_pixel(world, rig_[c].model, written[c].model);
      ASSERT_TRUE(expected);
      ASSERT_LT((*written[c].model.project(world) - *expected).norm(), 0.01);
    }
  }
}

TEST_F(TrainingExport, masks_are_the_silhouettes_that_the_written_cameras_see) {
  exported(TakeFormat::kColmap, {0, 1});
  for (const RigCamera& camera : written_rig(folder_ / "out")) {
    const Mask expected = mask_from_picture(test::ball_mask(camera));
    const Mask mask =
        mask_from_picture(read_picture(folder_ / "out/masks" / (camera.name + ".png.png")));
    EXPECT_GT(intersection_over_union(mask, expected), 0.9) << camera.name;
    EXPECT_EQ(read_picture(folder_ / "out/images" / (camera.name + ".png")).size, mask.size());
  }
}

/// The projection of a world point by a frame of transforms.json, pixels of that file.
Eigen::Vector2d opengl_pixel(const nlohmann::json& frame, const Eigen::Vector3d& world) {
  Eigen::Matrix4d pose;
  for (int row = 0; row < 4; ++row) {
    for (int column = 0; column < 4; ++column) {
      pose(row, column) = frame["transform_matrix"][row][column].get<double>();
    }
  }
  const Eigen::Vector4d p = pose.inverse() * world.homogeneous();  // y up, z backward
  return {frame["cx"].get<double>() - frame["fl_x"].get<double>() * p.x() / p.z(),
          frame["cy"].get<double>() + frame["fl_y"].get<double>() * p.y() / p.z()};
}

TEST_F(TrainingExport, nerfstudio_cameras_project_a_vertex_where_the_calibration_does) {
  exported(TakeFormat::kNerfstudio, {0, 1});
  const auto file = nlohmann::json::parse(read_file(folder_ / "out/transforms.json"));
  ASSERT_EQ(file["frames"].size(), rig_.size());
  for (size_t c = 0; c < rig_.size(); ++c) {
    const nlohmann::json& frame = file["frames"][c];
    const CameraModel pinhole = pinhole_of(rig_[c].model, rig_[c].name);
    EXPECT_EQ(frame["w"], pinhole.size().width);
    EXPECT_EQ(frame["mask_path"], "masks/" + rig_[c].name + ".png");
    for (const Eigen::Vector3f& vertex : mesh().vertices) {
      const Eigen::Vector3d world = vertex.cast<double>();
      const Eigen::Vector2d pixel = opengl_pixel(frame, world) - Eigen::Vector2d(0.5, 0.5);
      ASSERT_LT((pixel - *undistorted_pixel(world, rig_[c].model, pinhole)).norm(), 0.01);
    }
  }
  const Mesh points = read_ply(folder_ / "out/points.ply");
  EXPECT_GT(points.vertices.size(), mesh().vertices.size() / 2);
  EXPECT_EQ(points.colours.size(), points.vertices.size());
}

TEST_F(TrainingExport, rejects_a_take_without_raw_frames_and_one_without_meshes) {
  fs::rename(take_ / "c.lcmlog", folder_ / "c.lcmlog");
  EXPECT_THAT(rejection(TakeFormat::kColmap),
              testing::AllOf(HasSubstr("--format colmap: the take has no raw frames of c"),
                             HasSubstr("c.lcmlog does not exist")));
  fs::remove(take_ / "mesh.v3d");
  EXPECT_THAT(rejection(TakeFormat::kNerfstudio), HasSubstr("run v3dctl reconstruct"));
  EXPECT_FALSE(fs::exists(folder_ / "out"));
  EXPECT_THAT(leftovers(), testing::IsEmpty());
}

TEST_F(TrainingExport, on_a_full_disk_names_the_file_and_leaves_nothing) {
  const test::SmallDisk disk(folder_ / "disk", 4'000'000);
  ASSERT_TRUE(disk.is_mounted());
  disk.leave(20'000);
  for (const auto& [format, name] :
       {std::pair{TakeFormat::kColmap, "out"}, {TakeFormat::kGlbSequence, "out.glb"}}) {
    const std::string message = test::message_of<std::runtime_error>([&, f = format, n = name] {
      export_take({.take = take_, .out = folder_ / "disk" / n, .format = f});
    });
    EXPECT_THAT(message, testing::AllOf(HasSubstr("disk/out"), HasSubstr("No space left")));
  }
  EXPECT_EQ(std::distance(fs::directory_iterator(folder_ / "disk"), fs::directory_iterator()), 1)
      << "the filler alone";
}

/// glb-sequence and usda make their file in memory.
class SequenceExport : public TrainingExport {
 protected:
  void export_to(const fs::path& file) {
    export_take({.take = take_, .out = file, .format = TakeFormat::kUsda});
  }
};

TEST_F(SequenceExport, makes_the_folder_of_its_file) {
  export_to(folder_ / "new/deliveries/out.usda");
  ASSERT_TRUE(fs::exists(folder_ / "new/deliveries/out.usda"));
  EXPECT_EQ(
      std::distance(fs::directory_iterator(folder_ / "new/deliveries"), fs::directory_iterator()),
      1);
}

TEST_F(SequenceExport, rejects_a_file_that_cannot_be_written_before_it_reads_a_mesh) {
  std::string bytes = read_file(take_ / "mesh.v3d");
  bytes.at(16 + 24 + 10) ^= 1;  // in the payload of pulse 0
  test::write_text(take_ / "mesh.v3d", bytes);
  fs::create_directory(folder_ / "out.usda");
  test::write_text(folder_ / "file", "mine");
  const auto rejection = [&](const fs::path& file) {
    return test::message_of<InputError>([&] { export_to(file); });
  };
  EXPECT_THAT(rejection(folder_ / "other.usda"), HasSubstr("is damaged"));
  EXPECT_FALSE(fs::exists(folder_ / "other.usda"));
  EXPECT_THAT(rejection(folder_ / "out.usda"), HasSubstr("is a folder; expected the name of a"));
  EXPECT_THAT(rejection(folder_ / "file/out.usda"), HasSubstr("file: a file has this name"));
}

TEST_F(TrainingExport, without_a_frame_of_a_camera_leaves_it_out_and_is_incomplete) {
  test::truncate_file(take_ / "b.lcmlog", 0.6);
  EXPECT_EQ(exported(TakeFormat::kColmap), kExitIncomplete);
  EXPECT_EQ(written_rig(folder_ / "out/000000").size(), 6U);
  EXPECT_EQ(written_rig(folder_ / "out/000001").size(), 5U);
}

TEST_F(TrainingExport, has_no_view_of_a_camera_that_the_reconstruction_left_out) {
  ReconstructRequest request = request_;
  request.leave_out = {"c"};
  reconstruct_take(request);
  EXPECT_EQ(exported(TakeFormat::kColmap, {0, 1}), kExitDone) << "no camera is missing";
  const Rig written = written_rig(folder_ / "out");
  EXPECT_EQ(written.size(), rig_.size() - 1);
  EXPECT_EQ(find_camera(written, "c"), -1);
  EXPECT_FALSE(fs::exists(folder_ / "out/images/c.png"));
}

TEST_F(TrainingExport, rejects_a_file_in_the_place_of_the_folder) {
  test::write_text(folder_ / "out", "a file");
  EXPECT_THAT(rejection(TakeFormat::kColmap), HasSubstr("out: is a file"));
  EXPECT_EQ(read_file(folder_ / "out"), "a file");
}

}  // namespace
}  // namespace v3d::ctl
