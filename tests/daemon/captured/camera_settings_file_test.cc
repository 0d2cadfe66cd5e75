#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include "base/config/toml_file.h"
#include "daemon/captured/camera_monitor.h"
#include "support/temporary_folder.h"

namespace v3d::captured {
namespace {

capture::CameraWorkerStatus opened_camera() {
  capture::CameraWorkerStatus status;
  status.size = {640, 480};
  status.device = {"Maker \"Model\"", "1.2"};
  return status;
}

TEST(CameraSettings, lists_every_difference_of_every_opened_camera) {
  capture::CameraWorkerStatus other = opened_camera();
  other.differences = {{"GammaEnable", "false", "true"}, {"Gain (dB)", "3.005", "3.0", true}};
  const std::string text =
      camera_settings_text("cap01", {{"cam01", opened_camera()}, {"cam02", other}, {"cam03", {}}});
  const TomlTable file = TomlTable::parse(text, "settings.toml");
  const auto cameras = file.tables("camera");
  ASSERT_EQ(cameras.size(), 2U) << "cam03 was never opened";
  EXPECT_EQ(cameras[1].text("name"), "cam02");
  EXPECT_EQ(cameras[1].text("device"), "Maker \"Model\", firmware 1.2");
  const auto differences = file.tables("difference");
  ASSERT_EQ(differences.size(), 2U);
  EXPECT_EQ(differences[0].text("camera"), "cam02");
  EXPECT_EQ(differences[0].text("setting"), "GammaEnable");
  EXPECT_EQ(differences[0].text("asked"), "false");
  EXPECT_EQ(differences[0].text("got"), "true");
  EXPECT_FALSE(differences[0].boolean_or("rounded", true));
  EXPECT_TRUE(differences[1].boolean_or("rounded", false));
}

TEST(CameraSettings, are_written_again_only_after_a_change) {
  const test::TemporaryFolder folder;
  const std::filesystem::path path = folder / ".camera-settings-cap01.toml";
  const auto inode = [&] {
    struct stat entry {};
    stat(path.c_str(), &entry);
    return entry.st_ino;
  };
  CameraSettingsFile file(path);
  file.update("a = 1\n");
  const auto first = inode();
  file.update("a = 1\n");
  EXPECT_EQ(inode(), first);
  file.update("a = 2\n");
  EXPECT_EQ(TomlTable::load(path).integer("a"), 2);
}

TEST(CameraSettings, are_left_out_with_a_warning_where_the_folder_does_not_exist) {
  testing::internal::CaptureStdout();
  EXPECT_NO_THROW(CameraSettingsFile("/not/there/settings.toml").update("a = 1\n"));
  EXPECT_THAT(testing::internal::GetCapturedStdout(), testing::HasSubstr("/not/there"));
}

}  // namespace
}  // namespace v3d::captured
