#include "base/config/calib_file.h"

#include <gtest/gtest.h>

#include "base/core/error.h"
#include "base/io/file.h"
#include "support/message_of.h"

namespace v3d {
namespace {

constexpr std::string_view kGood = R"([cam_0]
name = "cam00"
size = [1024, 768]
matrix = [[899.975, -1.46795, 521.897], [0, 898.663, 383.998], [0, 0, 1]]
distortions = [-0.1, 0.01, 0.001, 0.002]
rotation = [1.98, -0.054, -0.035]
translation = [0.043, 0.792, 2.678]
fisheye = false

[metadata]
error = 0.2
)";

std::string message_for(std::string_view text) {
  return test::message_of<InputError>([&] { parse_calib(text, "calib.toml"); });
}

std::string with(std::string_view from, std::string_view to) {
  std::string text(kGood);
  return text.replace(text.find(from), from.size(), to);
}

TEST(CalibFile, reads_every_field_of_a_camera) {
  const Rig rig = parse_calib(kGood, "calib.toml");
  ASSERT_EQ(rig.size(), 1U);
  const CameraModel& m = rig[0].model;
  EXPECT_EQ(rig[0].name, "cam00");
  EXPECT_EQ(m.size(), (ImageSize{1024, 768}));
  EXPECT_EQ(m.matrix()(0, 1), -1.46795);
  EXPECT_EQ(m.distortion()[3], 0.002);
  EXPECT_EQ(m.distortion()[4], 0);
  EXPECT_NEAR((m.cam_from_world().rodrigues() - Eigen::Vector3d(1.98, -0.054, -0.035)).norm(), 0,
              1e-12);
}

TEST(CalibFile, save_and_load_return_the_same_rig) {
  const std::filesystem::path path = testing::TempDir() + "/v3d_calib_test.toml";
  const Rig rig = parse_calib(kGood, "calib.toml");
  save_calib(path, rig);
  const Rig again = load_calib(path);
  std::filesystem::remove(path);
  ASSERT_EQ(again.size(), 1U);
  EXPECT_EQ(again[0].model.matrix(), rig[0].model.matrix());
  EXPECT_EQ(again[0].model.distortion(), rig[0].model.distortion());
  EXPECT_EQ(again[0].model.cam_from_world().translation, rig[0].model.cam_from_world().translation);
  EXPECT_LT(
      (again[0].model.cam_from_world().rotation - rig[0].model.cam_from_world().rotation).norm(),
      1e-14);
}

TEST(CalibFile, reads_and_writes_the_optional_colour_response) {
  const std::filesystem::path path = testing::TempDir() + "/v3d_colour_test.toml";
  Rig rig = parse_calib(kGood, "calib.toml");
  EXPECT_TRUE(rig[0].colour.is_identity());
  rig[0].colour.black = {4, 5, 6.5};
  rig[0].colour.matrix << 1.1, 0.02, 0, -0.01, 0.9, 0, 0, 0.03, 1.25;
  save_calib(path, rig);
  const Rig again = load_calib(path);
  std::filesystem::remove(path);
  EXPECT_EQ(again[0].colour, rig[0].colour);
  EXPECT_EQ(message_for(with("fisheye = false", "colour_black = [1, 2]")),
            "calib.toml:8: cam_0.colour_black: expected 3 numbers, found 2");
}

TEST(CalibFile, reads_files_of_pose2sim) {
  std::string text = with("[cam_0]", "[left]");
  text.replace(text.find("[1024, 768]"), 11, "[ 1024.0, 768.0]");
  const Rig rig = parse_calib(text, "Calib.toml");
  ASSERT_EQ(rig.size(), 1U);
  EXPECT_EQ(rig[0].model.size(), (ImageSize{1024, 768}));
}

constexpr std::string_view kArray = R"([cameras.0]
cam_id = 0
rotation_count = 0
error = 0.5
ignore = false
size = [1280, 720]
matrix = [[900.0, 0.0, 640.0], [0.0, 910.0, 360.0], [0.0, 0.0, 1.0]]
distortions = [-0.3, 0.05, -0.004, 0.004, 0.07]
translation = [0.1, -0.2, 0.7]
rotation = [[0.0, -1.0, 0.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0]]

[cameras.1]
ignore = true

[cameras.12]
size = [640, 480]
matrix = [[500, 0, 320], [0, 500, 240], [0, 0, 1]]
distortions = []
translation = [1, 2, 3]
rotation = [0.5, 0, 0]
)";

TEST(CalibFile, reads_the_camera_array_of_caliscope) {
  const Rig rig = parse_calib(kArray, "camera_array.toml");
  ASSERT_EQ(rig.size(), 2U);
  EXPECT_EQ(rig[0].name, "cam_0");
  EXPECT_EQ(rig[1].name, "cam_12");
  EXPECT_EQ(rig[0].model.size(), (ImageSize{1280, 720}));
  EXPECT_EQ(rig[0].model.distortion()[4], 0.07);
  const RigidTransform& place = rig[0].model.cam_from_world();
  EXPECT_LT((place * Eigen::Vector3d(1, 0, 0) - Eigen::Vector3d(0.1, -0.2, 1.7)).norm(), 1e-12);
  EXPECT_LT((place * Eigen::Vector3d(0, 1, 0) - Eigen::Vector3d(-0.9, -0.2, 0.7)).norm(), 1e-12);
  EXPECT_NEAR(rig[1].model.cam_from_world().rodrigues().x(), 0.5, 1e-12);
}

TEST(CalibFile, reports_invalid_cameras_of_caliscope_with_their_line) {
  const auto message_with = [](std::string_view from, std::string_view to) {
    std::string text(kArray);
    text.replace(text.find(from), from.size(), to);
    return test::message_of<InputError>([&] { parse_calib(text, "camera_array.toml"); });
  };
  EXPECT_EQ(message_with("rotation = [0.5, 0, 0]\n", ""),
            "camera_array.toml:15: cameras.12.rotation: missing");
  EXPECT_EQ(message_with("[[0.0, -1.0, 0.0]", "[[0.0, 1.0, 0.0]"),
            "camera_array.toml:10: cameras.0.rotation: expected a rotation: a Rodrigues vector, or "
            "the rows of its matrix");
  EXPECT_EQ(message_with("[cameras.12]", "[cameras.\"../12\"]").find("camera_array.toml:15: "), 0U);
}

TEST(CalibFile, reports_file_line_and_name_of_a_missing_field) {
  EXPECT_EQ(message_for(with("rotation = [1.98, -0.054, -0.035]\n", "")),
            "calib.toml:1: cam_0.rotation: missing");
}

TEST(CalibFile, reports_the_expected_value_of_an_invalid_field) {
  EXPECT_EQ(message_for(with("[1024, 768]", "[1024]")),
            "calib.toml:3: cam_0.size: expected [width, height] in pixels, each from 1 to 16384");
  EXPECT_EQ(message_for(with("[-0.1, 0.01, 0.001, 0.002]", "[1, 2, 3]")),
            "calib.toml:5: cam_0.distortions: expected 0, 4, 5, 8, 12 or 14 numbers in OpenCV's "
            "order, found 3");
  EXPECT_EQ(message_for(with("[0, 0, 1]]", "[0, 0, 2]]")),
            "calib.toml:4: cam_0.matrix: expected [[fx, skew, cx], [0, fy, cy], [0, 0, 1]] with "
            "fx, fy > 0");
  EXPECT_EQ(message_for(with("\"cam00\"", "7")),
            "calib.toml:2: cam_0.name: expected a string, found integer");
  EXPECT_EQ(message_for(with("1.98", "nan")),
            "calib.toml:6: cam_0.rotation: expected a finite number, found floating-point");
  EXPECT_EQ(message_for(with("fisheye = false", "fisheye = true")),
            "calib.toml:8: cam_0.fisheye: fisheye lenses are not supported; calibrate with the "
            "pinhole model");
}

TEST(CalibFile, rejects_numbers_beyond_a_million) {
  const std::string limits = ": expected numbers from -1,000,000 to 1,000,000";
  for (const char* number : {"1e308", "-1e308", "2e6"}) {
    EXPECT_EQ(message_for(with("521.897", number)), "calib.toml:4: cam_0.matrix" + limits);
    EXPECT_EQ(message_for(with("-0.1", number)), "calib.toml:5: cam_0.distortions" + limits);
    EXPECT_EQ(message_for(with("1.98", number)), "calib.toml:6: cam_0.rotation" + limits);
    EXPECT_EQ(message_for(with("0.792", number)), "calib.toml:7: cam_0.translation" + limits);
  }
}

TEST(CalibFile, rejects_two_cameras_with_the_same_name) {
  const std::string text = std::string(kGood) + with("[cam_0]", "\n[cam_1]");
  EXPECT_EQ(message_for(text.substr(0, text.rfind("[metadata]"))),
            "calib.toml:14: cam_1.name: two cameras are named 'cam00'");
  const std::string both = with("cam00", "cam_0") + std::string(kArray);
  EXPECT_NE(message_for(both).find("two cameras are named 'cam_0'"), std::string::npos);
}

TEST(CalibFile, rejects_unsafe_and_reserved_camera_names) {
  EXPECT_NE(message_for(with("cam00", "../cam00")).find("is not a valid camera name"),
            std::string::npos);
  // Reserved for the log of the pulses, and for later segments of a log.
  EXPECT_NE(message_for(with("cam00", "pulses")).find("is not a valid camera name"),
            std::string::npos);
  EXPECT_NE(message_for(with("cam00", "cam.0001")).find("is not a valid camera name"),
            std::string::npos);
}

TEST(CalibFile, reports_invalid_toml_and_a_missing_camera) {
  EXPECT_EQ(message_for("a = 1\n"), "calib.toml: no camera: expected one [cam_*] table per camera");
  EXPECT_NE(message_for("[cam_0\n").find("calib.toml:1: "), std::string::npos);
}

}  // namespace
}  // namespace v3d
