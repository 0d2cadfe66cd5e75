// AravisCamera with an action trigger.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <string>
#include <string_view>
#include <vector>

#include "capture/cameras/aravis_camera.h"
#include "capture/fake_camera.h"

namespace v3d::capture {
namespace {

using std::chrono::milliseconds;
using testing::AllOf;
using testing::HasSubstr;

TEST(AravisCamera, writes_the_keys_of_an_action_trigger_and_enables_ptp) {
  const SimulatedCamera sim;
  StudioCamera wanted = settings();
  wanted.action =
      ActionKeys{.signal = 1, .device_key = 0xfedcba98, .group_key = 5, .group_mask = 0x80000001};
  AravisCamera camera(wanted);
  camera.start();
  using namespace sim::registers;
  EXPECT_EQ(sim.fake.read(kTriggerSource), static_cast<uint32_t>(sim::TriggerInput::kAction1));
  EXPECT_EQ(sim.fake.read(kActionDeviceKey), 0xfedcba98);
  EXPECT_EQ(sim.fake.read(kActionGroupKey), 5U);
  EXPECT_EQ(sim.fake.read(kActionGroupMask), 0x80000001);
  EXPECT_EQ(sim.fake.read(kPtpEnable), 1U);
  EXPECT_EQ(sim.fake.read(ARV_FAKE_CAMERA_REGISTER_TRIGGER_MODE), 1U);
  EXPECT_TRUE(camera.differences().empty());
  camera.wait(Monotonic::now() + milliseconds(1));
  EXPECT_TRUE(camera.statistics().ptp_offset) << "its clock is synchronised";
  EXPECT_TRUE(camera.statistics().ptp_locked);
}

TEST(AravisCamera, records_that_an_action_camera_does_not_follow_ptp) {
  const SimulatedCamera sim;
  sim.fake.write(sim::registers::kPtpUnlocked, 1);
  StudioCamera wanted = settings();
  wanted.action = ActionKeys{};
  AravisCamera camera(wanted);
  camera.start();
  EXPECT_EQ(camera.differences(),
            (std::vector<SettingDifference>{{"PtpStatus", "Slave or Master", "Listening"}}));
  camera.wait(Monotonic::now() + milliseconds(1));
  EXPECT_FALSE(camera.statistics().ptp_offset);
  EXPECT_FALSE(camera.statistics().ptp_locked);
}

/// The GenICam description of the simulator, without the offset of the clock.
std::string description_without_offset(const std::filesystem::path& path) {
  constexpr std::string_view kOffset = "PtpOffsetFromMaster";
  std::string xml = sim::genicam_xml();
  for (size_t at = xml.find(kOffset); at != std::string::npos; at = xml.find(kOffset)) {
    xml.replace(at, kOffset.size(), "Unknown");
  }
  std::ofstream(path) << xml;
  return path;
}

TEST(AravisCamera, has_a_locked_clock_although_the_camera_gives_no_offset) {
  const test::TemporaryFolder folder;
  const FakeCamera fake(description_without_offset(folder / "genicam.xml").c_str());
  StudioCamera wanted = settings();
  wanted.action = ActionKeys{};
  AravisCamera camera(wanted);
  camera.start();
  camera.wait(Monotonic::now() + milliseconds(1));
  EXPECT_FALSE(camera.statistics().ptp_offset);
  EXPECT_TRUE(camera.statistics().ptp_locked);
}

TEST(AravisCamera, names_a_camera_without_action_commands) {
  const FakeCamera fake;
  StudioCamera wanted = settings();
  wanted.action = ActionKeys{};
  EXPECT_THAT(start_error(wanted),
              AllOf(HasSubstr("cam07: ActionDeviceKey"), HasSubstr("without action commands")));
}

}  // namespace
}  // namespace v3d::capture
