#include "base/config/v4l2_address.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <string>

#include "base/core/error.h"
#include "support/message_of.h"
#include "support/temporary_folder.h"

namespace v3d {
namespace {

using testing::AllOf;
using testing::HasSubstr;

/// A folder like /dev/v4l.
class V4l2Address : public testing::Test {
 protected:
  V4l2Address() {
    for (const char* name :
         {"usb-046d_HD_Webcam_A1B2-video-index0", "usb-046d_HD_Webcam_A1B2-video-index1",
          "usb-046d_HD_Webcam_C3D4-video-index0"}) {
      add("by-id", name);
    }
    add("by-path", "pci-0000:00:14.0-usb-0:2:1.0-video-index0");
    add("by-path", "platform-vivid.0-video-index0");
  }
  void add(const char* folder, const std::string& name) {
    std::filesystem::create_directories(links_ / folder);
    std::ofstream(links_ / folder / name) << "";
  }
  std::filesystem::path device(const std::string& address) {
    StudioCamera camera;
    camera.name = "cam07";
    camera.address = address;
    return v4l2_device(camera, links_);
  }
  std::string error(const std::string& address) {
    return test::message_of<InputError>([&] { device(address); });
  }

  const test::TemporaryFolder folder_;
  const std::filesystem::path links_ = folder_ / "v4l";
};

TEST_F(V4l2Address, leaves_a_path_as_it_is) { EXPECT_EQ(device("/dev/video7"), "/dev/video7"); }

TEST_F(V4l2Address, finds_the_first_device_file_of_a_serial_number) {
  EXPECT_EQ(device("C3D4"), links_ / "by-id/usb-046d_HD_Webcam_C3D4-video-index0");
  EXPECT_EQ(device("A1B2"), links_ / "by-id/usb-046d_HD_Webcam_A1B2-video-index0");
}

TEST_F(V4l2Address, finds_a_bus_path) {
  EXPECT_EQ(device("bus:platform-vivid.0"), links_ / "by-path/platform-vivid.0-video-index0");
}

TEST_F(V4l2Address, lists_what_was_found_for_an_unknown_camera) {
  EXPECT_THAT(error("B2"), AllOf(HasSubstr("cam07"), HasSubstr("serial number 'B2'"),
                                 HasSubstr("usb-046d_HD_Webcam_A1B2, usb-046d_HD_Webcam_C3D4")));
  EXPECT_THAT(error("bus:platform-vivid.1"),
              AllOf(HasSubstr("bus path 'platform-vivid.1'"), HasSubstr("platform-vivid.0")));
  std::filesystem::remove_all(links_);
  EXPECT_THAT(error("A1B2"), HasSubstr("found: no camera"));
}

TEST_F(V4l2Address, rejects_a_serial_number_of_two_cameras) {
  add("by-id", "usb-Other_Webcam_A1B2-video-index0");
  EXPECT_THAT(error("A1B2"), HasSubstr("several cameras have the serial number 'A1B2'"));
  EXPECT_EQ(device("usb-Other_Webcam_A1B2"), links_ / "by-id/usb-Other_Webcam_A1B2-video-index0");
}

}  // namespace
}  // namespace v3d
