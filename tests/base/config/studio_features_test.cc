// Tables [[camera.features]], in which a feature occurs again.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/config/studio_file.h"
#include "base/core/error.h"
#include "support/message_of.h"

namespace v3d {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;

/// `defaults` and `own`: lines after the fields of [camera_defaults] and of the camera.
std::vector<CameraFeature> features_of(const std::string& defaults, const std::string& own) {
  const std::string text =
      "name = \"kyoto\"\n[[node]]\nname = \"cap01\"\n[camera_defaults]\nnode = \"cap01\"\n" +
      defaults + "[[camera]]\nname = \"cam01\"\naddress = \"1\"\n" + own +
      "[trigger]\nnode = \"cap01\"\nwire = \"wire\"\n[space]\nmin = [-1, -1, 0]\nmax = [1, 1, 2]\n"
      "[storage]\ntakes = \"takes\"\nbackground = \"background\"\ncalib = \"calib.toml\"\n"
      "[reconstruction]\nnode = \"cap01\"\n";
  return parse_studio(text, "studio.toml").cameras.at(0).features;
}

TEST(RepeatedFeatures, of_a_camera_are_read_in_the_order_of_the_file) {
  EXPECT_THAT(
      features_of("",
                  "[[camera.features]]\nLineSelector = \"Line1\"\nLineInverter = true\n"
                  "[[camera.features]]\nLineSelector = \"Line2\"\nLineInverter = false\n"),
      ElementsAre(CameraFeature{"LineSelector", "Line1"}, CameraFeature{"LineInverter", "true"},
                  CameraFeature{"LineSelector", "Line2"}, CameraFeature{"LineInverter", "false"}));
}

TEST(RepeatedFeatures, of_a_camera_replace_none_of_the_defaults) {
  EXPECT_THAT(
      features_of("[camera_defaults.features]\nLineSelector = \"Line1\"\n",
                  "[[camera.features]]\nLineSelector = \"Line2\"\n"),
      ElementsAre(CameraFeature{"LineSelector", "Line1"}, CameraFeature{"LineSelector", "Line2"}));
}

TEST(RepeatedFeatures, of_the_defaults_are_not_replaced_by_those_of_a_camera) {
  EXPECT_THAT(
      features_of("[[camera_defaults.features]]\nLineSelector = \"Line1\"\n"
                  "[[camera_defaults.features]]\nLineSelector = \"Line2\"\n",
                  "[camera.features]\nLineSelector = \"Line3\"\n"),
      ElementsAre(CameraFeature{"LineSelector", "Line1"}, CameraFeature{"LineSelector", "Line2"},
                  CameraFeature{"LineSelector", "Line3"}));
}

TEST(RepeatedFeatures, that_are_no_tables_are_rejected) {
  EXPECT_THAT(test::message_of<InputError>([] { features_of("", "features = [1, 2]\n"); }),
              HasSubstr("camera.features: expected a table"));
}

}  // namespace
}  // namespace v3d
