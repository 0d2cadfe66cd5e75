// The action trigger of a studio file.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/config/studio_file.h"
#include "base/core/error.h"
#include "support/message_of.h"

namespace v3d {
namespace {

using testing::HasSubstr;

/// A studio with the cameras cam01 and cam02. `trigger`: fields of [trigger]; `camera`: fields of
/// cam01.
std::string studio_text(const std::string& trigger, const std::string& camera) {
  return "name = \"kyoto\"\n[[node]]\nname = \"cap01\"\n[camera_defaults]\nnode = \"cap01\"\n"
         "[[camera]]\nname = \"cam01\"\n" +
         camera + "\n[[camera]]\nname = \"cam02\"\naddress = \"127.0.0.12\"\n" +
         "[trigger]\nnode = \"cap01\"\nkind = \"action\"\n" + trigger +
         "\n[space]\nmin = [-1, -1, 0]\nmax = [1, 1, 2]\n"
         "[storage]\ntakes = \"takes\"\nbackground = \"background\"\ncalib = \"calib.toml\"\n"
         "[reconstruction]\nnode = \"cap01\"\n";
}

std::string with_action(const std::string& more,
                        const std::string& camera = "address = \"127.0.0.11\"") {
  return studio_text("broadcast = \"192.168.5.255\"" + more, camera);
}

std::string message_for(const std::string& text) {
  return test::message_of<InputError>([&] { parse_studio(text, "/etc/v3d/studio.toml"); });
}

TEST(StudioAction, gives_the_keys_of_an_action_trigger_to_its_cameras) {
  const std::string text = with_action(
      "\ndevice_key = 4294967295\ngroup_key = 5\ngroup_mask = 6\nsignal = 2\nlead_ms = 4\n"
      "ptp_scale = \"utc\"");
  const Studio studio = parse_studio(text, "studio.toml");
  const ActionKeys keys{.signal = 2, .device_key = 4'294'967'295, .group_key = 5, .group_mask = 6};
  EXPECT_EQ(studio.trigger.kind, TriggerKind::kAction);
  EXPECT_TRUE(studio.trigger.is_sensed());
  EXPECT_EQ(studio.trigger.action.keys, keys);
  EXPECT_EQ(studio.trigger.action.broadcast, "192.168.5.255");
  EXPECT_EQ(studio.trigger.action.lead_ms, 4);
  EXPECT_EQ(studio.trigger.action.clock, PtpScale::kUtc);
  ASSERT_EQ(studio.trigger.action.cameras.size(), 2U);
  EXPECT_EQ(studio.trigger.action.cameras[1].name, "cam02");
  EXPECT_EQ(studio.trigger.action.cameras[1].address, "127.0.0.12");
  for (const StudioCamera& camera : studio.cameras) EXPECT_EQ(camera.action, keys);
}

TEST(StudioAction, names_what_an_action_trigger_cannot_do) {
  EXPECT_THAT(message_for(with_action("", "address = \"V3D-SIM-01\"")),
              HasSubstr("camera.address: 'V3D-SIM-01': with an action trigger, expected the IPv4 "
                        "address of the camera"));
  const std::string v4l2 = "address = \"/dev/video0\"\nkind = \"v4l2\"\npixel_format = \"Mono8\"";
  EXPECT_THAT(message_for(with_action("", v4l2 + "\ntrigger_control = \"1\"")),
              HasSubstr("camera.trigger_control: action commands do not reach V4L2 cameras; leave "
                        "it out, so that the camera is free-running"));
  const Studio free = parse_studio(with_action("", v4l2), "studio.toml");
  EXPECT_TRUE(free.cameras[0].is_free_running());
  EXPECT_EQ(free.trigger.action.cameras.size(), 1U) << "it acknowledges nothing";
  EXPECT_THAT(
      message_for(with_action("\ngroup_mask = 0")),
      HasSubstr("trigger.group_mask: expected a whole number from 1 to 4294967295, found 0"));
  EXPECT_THAT(message_for(with_action("\ndevice_key = 4294967296")),
              HasSubstr("trigger.device_key: expected a whole number from 0 to 4294967295"));
  EXPECT_THAT(message_for(with_action("\nlead_ms = 0")),
              HasSubstr("trigger.lead_ms: expected a number from 0.1 to 100"));
  EXPECT_THAT(message_for(with_action("\n[trigger.sense]\nchip = \"gpiochip0\"\nline = 1")),
              HasSubstr("sense"));
  EXPECT_THAT(message_for(studio_text("broadcast = \"cameras\"", "address = \"127.0.0.11\"")),
              HasSubstr("trigger.broadcast: 'cameras': expected the IPv4 broadcast address"));
}

}  // namespace
}  // namespace v3d
