// Settings of [[camera]] that only one kind of cameras has.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>
#include <utility>
#include <vector>

#include "base/config/studio_file.h"
#include "base/core/error.h"
#include "support/message_of.h"

namespace v3d {
namespace {

using testing::HasSubstr;

/// A field and its line, with a value that its kind of cameras has.
using FieldLine = std::pair<std::string, std::string>;
const std::vector<FieldLine> kOnlyAravis = {{"trigger_line", "trigger_line = \"Line1\"\n"},
                                            {"trigger_edge", "trigger_edge = \"rising\"\n"},
                                            {"packet_size", "packet_size = 9000\n"},
                                            {"packet_delay_ns", "packet_delay_ns = 0\n"},
                                            {"packet_resend", "packet_resend = true\n"},
                                            {"packet_socket", "packet_socket = true\n"},
                                            {"ptp", "ptp = false\n"},
                                            {"chunk_data", "chunk_data = false\n"}};
const std::vector<FieldLine> kOnlyV4l2 = {{"trigger_control", "trigger_control = \"1\"\n"},
                                          {"trigger_value", "trigger_value = 2\n"}};
constexpr char kV4l2Camera[] = "kind = \"v4l2\"\npixel_format = \"Mono8\"\n";

/// `defaults` and `own`: lines after the fields of [camera_defaults] and of the camera.
Studio studio_of(const std::string& defaults, const std::string& own) {
  return parse_studio(
      "name = \"kyoto\"\n[[node]]\nname = \"cap01\"\n[camera_defaults]\nnode = \"cap01\"\n" +
          defaults + "[[camera]]\nname = \"cam01\"\naddress = \"/dev/video0\"\n" + own +
          "[trigger]\nnode = \"cap01\"\nwire = \"wire\"\n"
          "[space]\nmin = [-1, -1, 0]\nmax = [1, 1, 2]\n"
          "[storage]\ntakes = \"takes\"\nbackground = \"background\"\ncalib = \"calib.toml\"\n"
          "[reconstruction]\nnode = \"cap01\"\n",
      "studio.toml");
}

std::string error_of_table(const std::string& own) {
  return test::message_of<InputError>([&] { studio_of("", own); });
}

TEST(CameraKinds, have_no_settings_of_another_kind_in_the_table_of_a_camera) {
  for (const auto& [field, line] : kOnlyAravis) {
    EXPECT_THAT(error_of_table(kV4l2Camera + line),
                HasSubstr("camera." + field + ": a V4L2 camera has no such setting"));
    EXPECT_EQ(studio_of("", line).cameras.size(), 1U) << field;
  }
  for (const auto& [field, line] : kOnlyV4l2) {
    EXPECT_THAT(error_of_table(line),
                HasSubstr("camera." + field + ": only a V4L2 camera has this setting"));
    EXPECT_EQ(studio_of("", kV4l2Camera + line).cameras.size(), 1U) << field;
  }
}

TEST(CameraKinds, with_a_trigger_line_have_the_edge_of_the_file) {
  EXPECT_EQ(studio_of("", "trigger_edge = \"falling\"\n").cameras.at(0).trigger_edge,
            Edge::kFalling);
}

TEST(CameraKinds, share_defaults_of_which_some_are_for_one_kind) {
  for (const auto* only : {&kOnlyAravis, &kOnlyV4l2}) {
    for (const auto& [field, line] : *only) {
      EXPECT_EQ(studio_of(line, "").cameras.size(), 1U) << field;
      EXPECT_EQ(studio_of(line, kV4l2Camera).cameras.size(), 1U) << field;
    }
  }
}

}  // namespace
}  // namespace v3d
