// Reading and writing calibrations of other programs.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include "base/core/error.h"
#include "calib/formats/opencv_file.h"
#include "calib/formats/rig_text.h"
#include "support/message_of.h"

namespace v3d::calib {
namespace {

using testing::HasSubstr;

double real_within(double low, double high) {
  return low + (high - low) * *rc::gen::inRange(0, 1'000'001) / 1e6;
}

/// A random camera whose first `distortions` coefficients are not 0.
CameraModel any_camera(int distortions) {
  Eigen::Matrix3d k = Eigen::Matrix3d::Identity();
  k(0, 0) = real_within(100, 5000);
  k(1, 1) = real_within(100, 5000);
  k(0, 2) = real_within(-100, 3000);
  k(1, 2) = real_within(-100, 3000);
  Distortion distortion{};
  for (int i = 0; i < distortions; ++i) distortion[i] = real_within(0.001, 0.1);
  const ImageSize size{*rc::gen::inRange(1, 4000), *rc::gen::inRange(1, 4000)};
  const Eigen::Vector3d turn(real_within(-3, 3), real_within(-3, 3), real_within(-3, 3));
  const Eigen::Vector3d move(real_within(-9, 9), real_within(-9, 9), real_within(-9, 9));
  return {size, k, distortion, RigidTransform::from_rodrigues(turn, move)};
}

Rig any_rig(std::initializer_list<int> distortions) {
  Rig rig;
  for (int i = *rc::gen::inRange(1, 5); i > 0; --i) {
    rig.push_back({"cam" + std::to_string(i),
                   any_camera(*rc::gen::elementOf(std::vector<int>(distortions)))});
  }
  return rig;
}

void expect_same(const CameraModel& a, const CameraModel& b) {
  RC_ASSERT(a.size() == b.size());
  RC_ASSERT((a.matrix() - b.matrix()).norm() < 1e-9);
  RC_ASSERT(a.distortion() == b.distortion());
  RC_ASSERT((a.cam_from_world().rotation - b.cam_from_world().rotation).norm() < 1e-12);
  RC_ASSERT(a.cam_from_world().translation == b.cam_from_world().translation);
}

void expect_same(const Rig& a, const Rig& b) {
  RC_ASSERT(a.size() == b.size());
  for (size_t i = 0; i < a.size(); ++i) {
    RC_ASSERT(a[i].name == b[i].name);
    expect_same(a[i].model, b[i].model);
  }
}

RC_GTEST_PROP(Colmap, reads_back_every_rig_with_supported_lenses, ()) {
  const Rig rig = any_rig({0, 1, 2, 4, 5, 8});
  expect_same(parse_colmap(colmap_text(rig), "sparse"), rig);
}

RC_GTEST_PROP(Middlebury, reads_back_every_rig_without_distortion, ()) {
  Rig rig = any_rig({0});
  const ImageSize size = rig[0].model.size();
  for (RigCamera& camera : rig) {
    const CameraModel& m = camera.model;
    camera.model = CameraModel(size, m.matrix(), {}, m.cam_from_world());
  }
  expect_same(parse_middlebury(middlebury_text(rig), size, "x_par.txt"), rig);
}

RC_GTEST_PROP(OpencvFile, reads_back_every_lens_and_pose_from_xml_and_yaml, ()) {
  const Rig rig = any_rig({0, 4, 5, 8, 12, 14});
  const auto format = *rc::gen::element(OpencvFormat::kXml, OpencvFormat::kYaml);
  for (const RigCamera& camera : rig) {
    expect_same(parse_opencv(opencv_text(camera, format), {"other"}, "c.yml"), {camera});
  }
}

constexpr char kCameras[] = R"(# a comment
1 SIMPLE_RADIAL 1024 768 900 512 384 -0.05
7 PINHOLE 640 480 500 501 320.5 240.5
)";
constexpr char kImages[] = R"(# a comment
3 1 0 0 0 0.1 0.2 0.3 7 left/000.png
10.5 20.5 -1 30.5 40.5 12
5 0.7071067811865476 0 0.7071067811865476 0 1 2 3 1 right/000.png

)";

TEST(Colmap, is_read_with_the_centre_of_the_first_pixel_at_zero) {
  const Rig rig = parse_colmap({kCameras, kImages}, "sparse");
  ASSERT_EQ(rig.size(), 2U);
  EXPECT_EQ(rig[0].name, "left");
  EXPECT_EQ(rig[0].model.matrix()(0, 2), 320);
  EXPECT_EQ(rig[0].model.matrix()(1, 1), 501);
  EXPECT_EQ(rig[1].name, "right");
  EXPECT_EQ(rig[1].model.matrix()(1, 1), 900);
  EXPECT_EQ(rig[1].model.distortion()[0], -0.05);
  // A quarter turn about y: the world's z axis becomes the camera's x axis.
  const Eigen::Vector3d z = rig[1].model.cam_from_world() * Eigen::Vector3d(0, 0, 1);
  EXPECT_LT((z - Eigen::Vector3d(2, 2, 3)).norm(), 1e-12);
}

std::string colmap_error(const std::string& cameras, const std::string& images) {
  return test::message_of<InputError>([&] { parse_colmap({cameras, images}, "sparse"); });
}

TEST(Colmap, rejects_unsupported_lens_models_by_name) {
  EXPECT_THAT(colmap_error("1 OPENCV_FISHEYE 640 480 1 1 1 1 0 0 0 0\n", kImages),
              HasSubstr("sparse/cameras.txt:1: lens model OPENCV_FISHEYE is not supported"));
}

TEST(Colmap, reports_errors_with_file_and_line) {
  EXPECT_EQ(colmap_error("1 PINHOLE 640 480 500 501 320\n", kImages),
            "sparse/cameras.txt:1: principal point: missing");
  EXPECT_THAT(colmap_error("1 PINHOLE 640 480 500 -1 320 240\n", kImages),
              HasSubstr("cameras.txt:1: focal length"));
  EXPECT_THAT(colmap_error("1 PINHOLE 640 0 500 501 320 240\n", kImages), HasSubstr("WIDTH"));
  EXPECT_THAT(colmap_error("1 PINHOLE 640 480 500 501 320 240 0\n", kImages),
              HasSubstr("too many parameters"));
  EXPECT_THAT(colmap_error(kCameras, "1 1 0 0 0 0 0 0 7 cam.0001.png\n\n"),
              HasSubstr("'cam.0001' is not a valid camera name"))
      << "a log has this name";
  EXPECT_EQ(colmap_error(kCameras, "1 1 0 0 0 0 0 0 2 a.png\n\n"),
            "sparse/images.txt:1: cameras.txt has no camera 2");
  EXPECT_THAT(colmap_error(kCameras, "1 1 1 0 0 0 0 0 7 a.png\n\n"),
              HasSubstr("quaternion of length 1"));
  EXPECT_THAT(colmap_error(kCameras, "1 1 0 0 0 0 0 0 7 a.png\n2 1 0 0 0 0 0 0 7 b.png\n"),
              HasSubstr("images.txt:2: expected the points of the image"));
  EXPECT_THAT(colmap_error(kCameras, "# none\n"), HasSubstr("contains no image"));
  EXPECT_THAT(colmap_error(kCameras, "1 1 0 0 0 0 0 0 7 a/1.png\n\n2 1 0 0 0 0 0 0 7 a/1.png\n"),
              HasSubstr("several images of one camera"));
}

TEST(Colmap, rejects_lenses_with_a_tilted_sensor_or_skew) {
  Distortion tilted{};
  tilted[12] = 0.01;
  Eigen::Matrix3d k = Eigen::Matrix3d::Identity();
  const auto error = [&](const CameraModel& model) {
    return test::message_of<InputError>([&] { colmap_text({{"cam3", model}}); });
  };
  EXPECT_THAT(error({{640, 480}, k, tilted, {}}), HasSubstr("cam3: its lens has a thin prism"));
  k(0, 1) = 1;
  EXPECT_THAT(error({{640, 480}, k, {}, {}}), HasSubstr("cam3: its lens has skew"));
}

std::string middlebury_error(const std::string& text) {
  return test::message_of<InputError>([&] { parse_middlebury(text, {640, 480}, "x_par.txt"); });
}

TEST(Middlebury, reports_errors_with_file_and_line) {
  const std::string k = "500 0 320 0 500 240 0 0 1", r = " 1 0 0 0 1 0 0 0 1", t = " 0 0 1\n";
  EXPECT_NO_THROW(parse_middlebury("1\na.png " + k + r + t, {640, 480}, "x_par.txt"));
  EXPECT_EQ(middlebury_error("2\na.png " + k + r + t),
            "x_par.txt:1: expected 2 images, found 1 lines");
  EXPECT_EQ(middlebury_error("1\na.png " + k + r + " 0 0\n"), "x_par.txt:2: t: missing");
  EXPECT_EQ(middlebury_error("1\na.png " + k + " 1 0 0 0 1 0 0 0 2" + t),
            "x_par.txt:2: R: not a rotation matrix");
  EXPECT_THAT(middlebury_error("1\na.png 500 0 x" + k + r + t), HasSubstr("found 'x500'"));
  EXPECT_THAT(middlebury_error("1\na.png " + k + r + " 0 0 1 9\n"), HasSubstr("22 words"));
  EXPECT_THAT(middlebury_error(""), HasSubstr("empty"));
}

TEST(Middlebury, rejects_a_lens_with_distortion) {
  const Rig rig = {{"cam2", CameraModel({640, 480}, Eigen::Matrix3d::Identity(), {0.1}, {})}};
  EXPECT_THAT(test::message_of<InputError>([&] { middlebury_text(rig); }),
              HasSubstr("cam2: its lens has distortion"));
}

constexpr char kYaml[] = R"(%YAML:1.0
---
K: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [ 500., 0., 320., 0., 501., 240., 0., 0., 1. ]
dist_coeffs: [ -0.1, 0.01, 0., 0. ]
rvec: [ 0., 0., 1.5707963267948966 ]
tvec: [ 1, 2, 3 ]
)";

TEST(OpencvFile, accepts_the_matrix_names_of_other_programs) {
  const Rig rig = parse_opencv(kYaml, {"cam4", ImageSize{640, 480}}, "c.yml");
  ASSERT_EQ(rig.size(), 1U);
  EXPECT_EQ(rig[0].name, "cam4");
  EXPECT_EQ(rig[0].model.matrix()(1, 1), 501);
  EXPECT_EQ(rig[0].model.distortion()[1], 0.01);
  const Eigen::Vector3d x = rig[0].model.cam_from_world() * Eigen::Vector3d(1, 0, 0);
  EXPECT_LT((x - Eigen::Vector3d(1, 3, 3)).norm(), 1e-12);
}

TEST(OpencvFile, with_a_stereo_pair_gives_two_cameras) {
  const Rig rig = parse_opencv(
      "%YAML:1.0\nM1: [ 1, 0, 2, 0, 1, 2, 0, 0, 1 ]\nD1: [ 0, 0, 0, 0 ]\n"
      "M2: [ 3, 0, 2, 0, 3, 2, 0, 0, 1 ]\nD2: [ 0, 0, 0, 0 ]\nR: [ 0, 0, 0 ]\nT: [ 1, 0, 0 ]\n",
      {"rig", ImageSize{640, 480}}, "s.yml");
  ASSERT_EQ(rig.size(), 2U);
  EXPECT_EQ(rig[0].name, "rig_1");
  EXPECT_EQ(rig[1].model.matrix()(0, 0), 3);
  EXPECT_EQ(rig[1].model.center(), Eigen::Vector3d(-1, 0, 0));
}

std::string opencv_error(std::string text, const std::string& from, const std::string& to) {
  text.replace(text.find(from), from.size(), to);
  return test::message_of<InputError>([&] {
    parse_opencv(text, {"cam4", ImageSize{640, 480}}, "c.yml");
  });
}

TEST(OpencvFile, reports_missing_and_invalid_fields) {
  EXPECT_EQ(opencv_error(kYaml, "K:", "L:"), "c.yml: camera_matrix: expected 9 numbers, found 0");
  EXPECT_EQ(opencv_error(kYaml, "500., 0.,", "500., 1e400,"),
            "c.yml: camera_matrix: expected finite numbers");
  EXPECT_EQ(opencv_error(kYaml, ", 0.01", ""),
            "c.yml: distortion_coefficients: expected 0, 4, 5, 8, 12 or 14 numbers, found 3");
  EXPECT_EQ(opencv_error(kYaml, "tvec", "other"), "c.yml: T: expected 3 numbers, found 0");
  EXPECT_THAT(opencv_error(kYaml, "tvec", "fisheye_model: 1\ntvec"), HasSubstr("fisheye"));
  EXPECT_THAT(opencv_error(kYaml, "%YAML:1.0", "words"), HasSubstr("c.yml: not an XML, YAML"));
  EXPECT_THAT(test::message_of<InputError>([&] { parse_opencv(kYaml, {"cam4"}, "c.yml"); }),
              HasSubstr("use --size"));
}

TEST(OpencvFile, without_distortion_coefficients_is_rejected) {
  EXPECT_EQ(opencv_error(kYaml, "dist_coeffs", "lens_errors"),
            "c.yml: does not contain distortion_coefficients; for a lens without distortion, give "
            "it 5 zeros");
}

TEST(OpencvFile, accepts_the_other_names_of_distortion_coefficients) {
  for (const std::string name : {"dist_coeff", "dist_coefs", "distortion", "dist"}) {
    std::string text = kYaml;
    text.replace(text.find("dist_coeffs"), 11, name);
    const Rig rig = parse_opencv(text, {"cam4", ImageSize{640, 480}}, "c.yml");
    EXPECT_EQ(rig[0].model.distortion()[0], -0.1) << name;
  }
}

TEST(OpencvFile, with_deeply_nested_nodes_is_rejected) {
  const std::string deep = "%YAML:1.0\na: " + std::string(100'000, '[');
  EXPECT_THAT(test::message_of<InputError>([&] { parse_opencv(deep, {"c"}, "c.yml"); }),
              HasSubstr("not a camera calibration"));
}

TEST(MetricRig, is_in_metres_and_has_z_up) {
  const CameraModel camera({640, 480}, Eigen::Matrix3d::Identity(), {},
                           {Eigen::Matrix3d::Identity(), Eigen::Vector3d(0, 0, 2000)});
  // It looks along the old z, and the old y points down, as is usual in COLMAP.
  const Rig rig = metric_rig({{"c", camera}}, 0.001, "-y");
  EXPECT_LT((rig[0].model.center() - Eigen::Vector3d(0, -2, 0)).norm(), 1e-12);
  EXPECT_LT((rig[0].model.viewing_direction() - Eigen::Vector3d::UnitY()).norm(), 1e-12);
  for (const std::string up : {"x", "-x", "y", "-y", "z", "-z"}) {
    const RigCamera moved = metric_rig({{"c", camera}}, 1, up)[0];
    EXPECT_NEAR(moved.model.cam_from_world().rotation.determinant(), 1, 1e-12) << up;
    Eigen::Vector3d axis =
        Eigen::Vector3d::Zero();  // in the camera's frame, which is the old world
    axis[up.back() - 'x'] = up.front() == '-' ? -1 : 1;
    EXPECT_LT((moved.model.cam_from_world().rotation.transpose() * axis - Eigen::Vector3d::UnitZ())
                  .norm(),
              1e-12)
        << up;
  }
  EXPECT_THAT(test::message_of<InputError>([&] { metric_rig({}, 1, "up"); }),
              HasSubstr("expected x, y, z"));
}

}  // namespace
}  // namespace v3d::calib
