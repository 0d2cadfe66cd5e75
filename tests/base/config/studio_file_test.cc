#include "base/config/studio_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/core/error.h"
#include "support/message_of.h"

namespace v3d {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

constexpr std::string_view kGood = R"(name = "kyoto"

[[node]]
name = "cap01"
[[node]]
name = "recon01"

[camera_defaults]
exposure_us = 800
packet_size = 8000

[[camera]]
name = "cam01"
node = "cap01"
address = "V3D-SIM-01"

[[camera]]
name = "cam02"
node = "cap01"
address = "127.0.0.12"
pixel_format = "Mono8"
packet_size = 1500

[trigger]
node = "cap01"
kind = "simulated"
rate_hz = 25
wire = "trigger.sock"

[space]
min = [-1.5, -1.5, 0]
max = [1.5, 1.5, 2]

[storage]
takes = "takes"
background = "/var/lib/v3d/background"
calib = "calib.toml"

[reconstruction]
node = "recon01"
voxel_m = 0.008
min_views = 2
)";

std::string message_for(std::string_view text) {
  return test::message_of<InputError>([&] { parse_studio(text, "/etc/v3d/studio.toml"); });
}

std::string with(std::string_view from, std::string_view to) {
  std::string text(kGood);
  return text.replace(text.find(from), from.size(), to);
}

TEST(StudioFile, settings_of_a_camera_override_the_defaults) {
  const Studio studio = parse_studio(kGood, "/etc/v3d/studio.toml");
  ASSERT_EQ(studio.cameras.size(), 2U);
  EXPECT_EQ(studio.cameras[0].packet_size, 8000);
  EXPECT_EQ(studio.cameras[0].pixel_format, PixelFormat::kBayerRG8);
  EXPECT_EQ(studio.cameras[1].packet_size, 1500);
  EXPECT_EQ(studio.cameras[1].pixel_format, PixelFormat::kMono8);
  EXPECT_EQ(studio.cameras[1].exposure_us, 800);
  EXPECT_EQ(studio.cameras_of("cap01").size(), 2U);
  EXPECT_TRUE(studio.cameras_of("recon01").empty());
  EXPECT_EQ(studio.reconstruction.nodes, std::vector<std::string>{"recon01"});
  EXPECT_EQ(studio.reconstruction.voxel_m, 0.008);
}

TEST(StudioFile, uses_the_default_node_and_reports_a_missing_one) {
  std::string text = with("exposure_us = 800", "node = \"cap01\"");
  text.erase(text.find("node = \"cap01\"\naddress"), 15);
  EXPECT_EQ(parse_studio(text, "studio.toml").cameras[0].node, "cap01");
  EXPECT_EQ(message_for(with("node = \"cap01\"\naddress", "address")),
            "/etc/v3d/studio.toml:12: camera.node: missing: name the [[node]] here or in "
            "[camera_defaults]");
}

TEST(StudioFile, resolves_relative_paths_from_its_own_folder) {
  const Studio studio = parse_studio(kGood, "/etc/v3d/studio.toml");
  EXPECT_EQ(studio.storage.takes, "/etc/v3d/takes");
  EXPECT_EQ(studio.storage.background, "/var/lib/v3d/background");
  EXPECT_EQ(studio.trigger.wire, "/etc/v3d/trigger.sock");
}

TEST(StudioFile, viewer_listens_on_loopback_by_default) {
  EXPECT_EQ(parse_studio(kGood, "/studio/studio.toml").viewer.listen, "127.0.0.1:8330");
  const Studio studio = parse_studio(
      std::string(kGood) + "[viewer]\nlisten = \"0.0.0.0:80\"\ntoken = \"viewer.token\"\n",
      "/studio/studio.toml");
  EXPECT_EQ(studio.viewer.listen, "0.0.0.0:80");
  EXPECT_EQ(studio.viewer.token, "/studio/viewer.token");
}

TEST(StudioFile, viewer_control_is_off_by_default) {
  EXPECT_FALSE(parse_studio(kGood, "/studio/studio.toml").viewer.control);
  const Studio studio = parse_studio(
      std::string(kGood) + "[viewer]\ncontrol = true\noperator_token = \"operator.token\"\n",
      "/studio/studio.toml");
  EXPECT_TRUE(studio.viewer.control);
  EXPECT_EQ(studio.viewer.operator_token, "/studio/operator.token");
}

TEST(StudioFile, rejects_two_cameras_or_two_nodes_with_the_same_name) {
  EXPECT_EQ(message_for(with("\"cam02\"", "\"cam01\"")),
            "/etc/v3d/studio.toml:18: camera.name: two cameras are named 'cam01'");
  EXPECT_EQ(message_for(with("\"recon01\"", "\"cap01\"")),
            "/etc/v3d/studio.toml:6: node.name: two nodes are named 'cap01'");
}

TEST(StudioFile, reports_an_unknown_node) {
  EXPECT_EQ(message_for(with("node = \"cap01\"", "node = \"cap02\"")),
            "/etc/v3d/studio.toml:14: camera.node: there is no [[node]] named 'cap02'");
}

TEST(StudioFile, accepts_one_or_several_reconstruction_nodes) {
  const std::string text =
      with("[camera_defaults]", "[[node]]\nname = \"recon02\"\n[camera_defaults]");
  const auto shared = [&](const std::string& line) {
    std::string changed = text;
    changed.replace(changed.find("node = \"recon01\""), 16, line);
    return changed;
  };
  const Studio studio = parse_studio(shared("nodes = [\"recon02\", \"recon01\"]"), "studio.toml");
  EXPECT_EQ(studio.reconstruction.nodes, (std::vector<std::string>{"recon01", "recon02"}));
  EXPECT_TRUE(studio.reconstructs("recon02"));
  EXPECT_FALSE(studio.reconstructs("cap01"));
  const std::string where = "/etc/v3d/studio.toml:42: reconstruction.";
  EXPECT_EQ(message_for(shared("nodes = [\"recon01\", \"recon03\"]")),
            where + "nodes: there is no [[node]] named 'recon03'");
  EXPECT_EQ(message_for(shared("nodes = [\"recon01\", \"recon01\"]")),
            where + "nodes: 'recon01' is listed twice");
  EXPECT_THAT(message_for(shared("nodes = [\"recon01\", \"recon02\"]\nperformers = true")),
              HasSubstr("reconstruction.performers: expected false with 2 reconstruction nodes: "));
  EXPECT_EQ(message_for(shared("nodes = [\"recon01\", \"recon02\"]\ndeadline_ms = 12000")),
            "/etc/v3d/studio.toml:43: reconstruction.deadline_ms: expected at most 10000 with 2 "
            "reconstruction nodes");
  EXPECT_EQ(message_for(shared("nodes = []")),
            where + "nodes: expected the names of [[node]]s, found none");
  EXPECT_EQ(message_for(shared("node = \"recon01\"\nnodes = [\"recon02\"]")),
            where + "node: expected either node or nodes, found both");
}

std::string with_frame_groups(const std::string& groups) {
  return std::string(kGood) + "[network]\nframe_groups = [" + groups + "]\n";
}

TEST(StudioFile, reads_the_multicast_groups_of_live_frames) {
  EXPECT_TRUE(parse_studio(kGood, "studio.toml").network.frame_groups.empty());
  const Studio studio = parse_studio(
      with_frame_groups(R"("udpm://239.255.76.68:7668?ttl=1", "udpm://239.255.76.69:7669")"),
      "studio.toml");
  EXPECT_EQ(
      studio.network.frame_groups,
      (std::vector<std::string>{"udpm://239.255.76.68:7668?ttl=1", "udpm://239.255.76.69:7669"}));
}

TEST(StudioFile, rejects_frame_groups_that_share_an_address_or_a_port) {
  for (const char* groups : {R"("udpm://239.255.76.68:7667")", R"("udpm://239.255.76.67:7668")",
                             R"("udpm://239.255.76.68:7668", "udpm://239.255.76.69:7668")",
                             R"("udpm://239.255.76.68:7668", "udpm://239.255.76.68:7669")"}) {
    EXPECT_THAT(message_for(with_frame_groups(groups)),
                HasSubstr("network.frame_groups: 'udpm://239.255.76.6"));
    EXPECT_THAT(message_for(with_frame_groups(groups)),
                HasSubstr("share an address or a port; use different ones for each group"));
  }
  EXPECT_THAT(message_for(with_frame_groups(R"("udpm://10.0.0.1:7668")")),
              HasSubstr("'udpm://10.0.0.1:7668' is not a multicast group; expected one like "
                        "udpm://239.255.76.68:7668"));
}

TEST(StudioFile, reports_an_unknown_field_and_the_known_ones) {
  const std::string message = message_for(with("packet_size = 1500", "packetsize = 1500"));
  EXPECT_EQ(message.find("/etc/v3d/studio.toml:22: camera.packetsize: unknown field; known here: "),
            0U)
      << message;
  EXPECT_NE(message.find("packet_size"), std::string::npos);
}

TEST(StudioFile, repairs_silhouettes_and_labels_performers_of_live_meshes_on_request) {
  const auto live = [](std::string_view line) {
    return parse_studio(with("min_views = 2", line), "/etc/v3d/studio.toml").reconstruction;
  };
  EXPECT_FALSE(live("").repair || live("").performers);
  EXPECT_TRUE(live("repair = true").repair);
  EXPECT_TRUE(live("performers = true").performers);
}

TEST(StudioFile, rejects_values_out_of_range_and_reports_the_range) {
  EXPECT_EQ(message_for(with("exposure_us = 800", "exposure_us = -1")),
            "/etc/v3d/studio.toml:9: camera_defaults.exposure_us: expected a number from 1 to "
            "1000000, found -1");
  EXPECT_EQ(message_for(with("min_views = 2", "min_views = 3")),
            "/etc/v3d/studio.toml:42: reconstruction.min_views: expected a whole number from 1 to "
            "2, found 3");
  EXPECT_EQ(message_for(with("max = [1.5, 1.5, 2]", "max = [1.5, 1.5, 0]")),
            "/etc/v3d/studio.toml:32: space.max: expected values above min in x, y and z");
  EXPECT_THAT(message_for(with("\"Mono8\"", "\"Mono14\"")),
              AllOf(HasSubstr("/etc/v3d/studio.toml:21: camera.pixel_format: 'Mono14' is unknown; "
                              "known: Mono8, BayerGR8"),
                    HasSubstr("BayerRG12Packed"), Not(HasSubstr("MJPEG"))));
  EXPECT_EQ(message_for(with("exposure_us = 800", "chroma_key = \"pink\"")),
            "/etc/v3d/studio.toml:9: camera_defaults.chroma_key: 'pink' is unknown; known: none, "
            "green, blue");
  EXPECT_EQ(message_for(with("rate_hz = 25", "rate_hz = 5000")),
            "/etc/v3d/studio.toml:27: trigger.rate_hz: expected a number from 0.01 to 1000, found "
            "5000");
  EXPECT_EQ(message_for(with("rate_hz = 25", "rate_hz = 25\npulse_width_us = 40000")),
            "/etc/v3d/studio.toml:28: trigger.pulse_width_us: a pulse must be shorter than the "
            "period of 40000 us");
}

TEST(StudioFile, reads_the_chroma_key_and_rejects_it_for_mono_cameras) {
  const std::string text =
      with("address = \"V3D-SIM-01\"", "address = \"V3D-SIM-01\"\nchroma_key = \"green\"");
  EXPECT_EQ(parse_studio(text, "studio.toml").cameras[0].chroma_key, ChromaKey::kGreen);
  EXPECT_EQ(parse_studio(text, "studio.toml").cameras[1].chroma_key, ChromaKey::kNone);
  EXPECT_EQ(message_for(with("packet_size = 1500", "chroma_key = \"green\"")),
            "/etc/v3d/studio.toml:22: camera.chroma_key: a Mono8 picture has no colour; expected "
            "none, or a pixel_format with colour");
}

constexpr std::string_view kSimulated =
    "kind = \"simulated\"\nrate_hz = 25\nwire = \"trigger.sock\"";

TEST(StudioFile, reads_gpio_lines_by_name_or_number) {
  const Studio studio = parse_studio(with(kSimulated, R"(kind = "gpio"
chip = "gpiochip0"
line = 7
active_low = true
[trigger.sense]
chip = "pinctrl-bcm2711"
line = "SENSE"
edge = "falling")"),
                                     "studio.toml");
  EXPECT_EQ(studio.trigger.kind, TriggerKind::kGpio);
  EXPECT_EQ(studio.trigger.output.chip, "gpiochip0");
  EXPECT_EQ(studio.trigger.output.line, "7");
  EXPECT_TRUE(studio.trigger.output.active_low);
  ASSERT_TRUE(studio.trigger.sense);
  EXPECT_EQ(studio.trigger.sense->line, "SENSE");
  EXPECT_TRUE(studio.trigger.sense->active_low);
  EXPECT_EQ(message_for(with(kSimulated, "kind = \"gpio\"\nchip = \"gpiochip0\"\nline = -2")),
            "/etc/v3d/studio.toml:28: trigger.line: expected a whole number from 0 to 65535, "
            "found -2");
}

TEST(StudioFile, reads_the_usb_or_serial_address_of_a_signal_generator) {
  const auto scpi = [](std::string_view instrument) {
    return with(kSimulated, "kind = \"scpi\"\ndialect = \"rigol-dg\"\ninstrument = \"" +
                                std::string(instrument) + "\"");
  };
  for (const std::string good : {"usb:1ab1:0642", "usb:1ab1:0642:DG1ZA:1", "serial:/dev/ttyUSB0"}) {
    const Studio studio = parse_studio(scpi(good), "studio.toml");
    EXPECT_EQ(studio.trigger.dialect, Dialect::kRigolDg);
    EXPECT_EQ(studio.trigger.instrument.text(), good);
  }
  for (const std::string bad : {"", "usb", "usb:1ab1", "usb:1ab1:", "usb:1ab1:642", "usb:1ab1:064g",
                                "usb:1ab1:0642:", "usb:1ab1-0642", "serial:", "serial:ttyUSB0"}) {
    EXPECT_EQ(message_for(scpi(bad)),
              "/etc/v3d/studio.toml:28: trigger.instrument: '" + bad +
                  "': expected usb:VVVV:PPPP, usb:VVVV:PPPP:SERIAL (numbers as lsusb writes them) "
                  "or serial:/dev/NAME");
  }
}

TEST(StudioFile, reads_the_speed_of_a_serial_port) {
  const auto scpi = [](std::string_view instrument, std::string_view baud) {
    return with(kSimulated, "kind = \"scpi\"\ndialect = \"bnc575\"\ninstrument = \"" +
                                std::string(instrument) + "\"\n" + std::string(baud));
  };
  const auto baud_of = [](const std::string& text) {
    return parse_studio(text, "studio.toml").trigger.instrument.baud;
  };
  EXPECT_EQ(baud_of(scpi("serial:/dev/ttyUSB0", "")), 115'200);
  EXPECT_EQ(baud_of(scpi("serial:/dev/ttyUSB0", "baud = 38400")), 38'400);
  EXPECT_EQ(message_for(scpi("serial:/dev/ttyUSB0", "baud = 38401")),
            "/etc/v3d/studio.toml:29: trigger.baud: expected 4800, 9600, 19200, 38400, 57600, "
            "115200, 230400 or 460800, found 38401");
  EXPECT_THAT(message_for(scpi("usb:1ab1:0642", "baud = 38400")), HasSubstr("trigger.baud"));
}

TEST(StudioFile, reports_missing_fields) {
  EXPECT_EQ(message_for(with("calib = \"calib.toml\"\n", "")),
            "/etc/v3d/studio.toml:34: storage.calib: missing");
  EXPECT_EQ(message_for("name = \"x\"\n"),
            "/etc/v3d/studio.toml:1: node: missing: expected one [[node]] per PC");
  EXPECT_EQ(message_for(with("name = \"kyoto\"\n", "")), "/etc/v3d/studio.toml:1: name: missing");
}

TEST(StudioFile, reads_the_trigger_settings_of_a_v4l2_camera) {
  const std::string v4l2 = with("address = \"V3D-SIM-01\"",
                                "address = \"/dev/video0\"\nkind = \"v4l2\"\nwidth = 640\n"
                                "height = 480\ntrigger_control = \"0x009a0914\"\n"
                                "trigger_value = 2");
  const StudioCamera camera = parse_studio(v4l2, "studio.toml").cameras[0];
  EXPECT_EQ(camera.kind, CameraKind::kV4l2);
  EXPECT_EQ(camera.trigger_control, 0x009a0914U);
  EXPECT_EQ(camera.trigger_value, 2);
  EXPECT_EQ(camera.size, (ImageSize{640, 480}));
}

TEST(StudioFile, reads_the_pixel_formats_of_both_kinds_of_cameras) {
  const auto format_of = [](const std::string& lines) {
    return parse_studio(with("address = \"V3D-SIM-01\"", lines), "studio.toml")
        .cameras[0]
        .pixel_format;
  };
  EXPECT_EQ(format_of("address = \"V3D-SIM-01\"\npixel_format = \"BayerRG12Packed\""),
            CameraFormat(PixelFormat::kBayerRG12, PixelLayout::kGigePacked));
  EXPECT_EQ(format_of("address = \"V3D-SIM-01\"\npixel_format = \"Mono10p\""),
            CameraFormat(PixelFormat::kMono10, PixelLayout::kLsbPacked));
  const std::string v4l2 = "address = \"A1B2\"\nkind = \"v4l2\"\ntrigger_control = \"1\"\n";
  EXPECT_EQ(format_of(v4l2 + "pixel_format = \"MJPEG\""),
            CameraFormat(PixelFormat::kRGB8, PixelLayout::kJpeg));
  EXPECT_EQ(format_of(v4l2 + "pixel_format = \"BayerGB10MIPI\""),
            CameraFormat(PixelFormat::kBayerGB10, PixelLayout::kMipi));
}

TEST(StudioFile, reads_the_features_of_a_camera_in_the_order_of_the_file) {
  const std::string text = with(
      "packet_size = 8000",
      "packet_size = 8000\n[camera_defaults.features]\nZoom = 2\nGamma = 0.45\nAlpha = \"On\"");
  const std::string own = "address = \"V3D-SIM-01\"";
  std::string both = text;
  both.replace(both.find(own), own.size(), own + "\n[camera.features]\nNight = true\nGamma = 1.0");
  const Studio studio = parse_studio(both, "studio.toml");
  EXPECT_EQ(studio.cameras[1].features,
            (std::vector<CameraFeature>{{"Zoom", "2"}, {"Gamma", "0.45"}, {"Alpha", "On"}}));
  EXPECT_EQ(studio.cameras[0].features,
            (std::vector<CameraFeature>{
                {"Zoom", "2"}, {"Alpha", "On"}, {"Night", "true"}, {"Gamma", "1.0"}}));
  EXPECT_THAT(message_for(with("packet_size = 8000",
                               "packet_size = 8000\n[camera_defaults.features]\nLut = [1, 2]")),
              HasSubstr("camera_defaults.features.Lut: expected a string"));
}

TEST(StudioFile, reads_the_region_and_the_image_settings_of_a_genicam_camera) {
  const std::string address = "address = \"V3D-SIM-01\"";
  const StudioCamera camera =
      parse_studio(
          with(address, address + "\nwidth = 640\nheight = 480\noffset_x = 16\noffset_y = 8\n"
                                  "binning = 2\nreverse_y = true\nblack_level = 4.5\n"
                                  "strobe_line = \"Line2\"\nuser_set = \"Default\""),
          "studio.toml")
          .cameras[0];
  EXPECT_EQ(camera.size, (ImageSize{640, 480}));
  EXPECT_EQ(camera.offset_x, 16);
  EXPECT_EQ(camera.offset_y, 8);
  EXPECT_EQ(camera.binning, 2);
  EXPECT_FALSE(camera.reverse_x);
  EXPECT_TRUE(camera.reverse_y);
  EXPECT_EQ(camera.black_level, 4.5);
  EXPECT_EQ(camera.strobe_line, "Line2");
  EXPECT_EQ(camera.user_set, "Default");
  EXPECT_THAT(message_for(with(address, address + "\nbinning = 9")),
              HasSubstr("camera.binning: expected a whole number from 1 to 8, found 9"));
  EXPECT_THAT(message_for(with(address, address + "\nblack_level = -4097")),
              HasSubstr("camera.black_level: expected a number from -4096 to 4096, found -4097"));
  EXPECT_THAT(message_for(with(address, address + "\noffset_y = 8")),
              HasSubstr("camera.offset_y: expected width and height of the region, too"));
  EXPECT_THAT(message_for(with(address, address + "\nkind = \"v4l2\"\ntrigger_control = \"1\"\n"
                                                  "binning = 2")),
              HasSubstr("camera.binning: a V4L2 camera has no such setting"));
}

TEST(StudioFile, rejects_a_pixel_format_that_the_kind_of_camera_lacks) {
  const std::string address = "address = \"V3D-SIM-01\"";
  EXPECT_THAT(message_for(with(address, address + "\npixel_format = \"YUYV\"")),
              AllOf(HasSubstr("camera.pixel_format: GenICam has no YUYV; expected one of Mono8"),
                    HasSubstr("BayerRG10p")));
  EXPECT_THAT(message_for(with(address, address + "\nkind = \"v4l2\"\ntrigger_control = \"1\"\n"
                                                  "pixel_format = \"BayerRG12Packed\"")),
              AllOf(HasSubstr("camera.pixel_format: V4L2 has no BayerRG12Packed; expected one of"),
                    HasSubstr("BayerRG12MIPI"), HasSubstr("MJPEG")));
  EXPECT_THAT(message_for(with("pixel_format = \"Mono8\"",
                               "chroma_key = \"green\"\npixel_format = \"Mono12p\"")),
              HasSubstr("a Mono12p picture has no colour"));
}

TEST(StudioFile, reports_the_requirements_of_a_free_running_camera) {
  const std::string free =
      with("address = \"V3D-SIM-01\"", "address = \"/dev/video0\"\nkind = \"v4l2\"");
  const Studio studio = parse_studio(free, "studio.toml");
  EXPECT_TRUE(studio.cameras[0].is_free_running());
  EXPECT_FALSE(studio.cameras[1].is_free_running());
  const auto changed = [&](std::string_view from, std::string_view to) {
    std::string text = free;
    return text.replace(text.find(from), from.size(), to);
  };
  EXPECT_THAT(message_for(changed("[trigger]\nnode = \"cap01\"", "[trigger]\nnode = \"recon01\"")),
              HasSubstr("camera.trigger_control: missing, so cam01 is free-running; connect it to "
                        "the trigger's node, recon01"));
  EXPECT_THAT(message_for(changed("kind = \"simulated\"\nrate_hz = 25\nwire = \"trigger.sock\"",
                                  "kind = \"gpio\"\nchip = \"gpiochip0\"\nline = 7")),
              HasSubstr("cam01 is free-running; add [trigger.sense]"));
}

TEST(StudioFile, rejects_invalid_settings_of_a_v4l2_camera) {
  const std::string address = "address = \"V3D-SIM-01\"";
  const std::string v4l2 = address + "\nkind = \"v4l2\"\n";
  EXPECT_THAT(message_for(with(address, v4l2 + "trigger_control = \"0x9a09zz\"")),
              HasSubstr("expected the id of a V4L2 control"));
  EXPECT_THAT(message_for(with(address, v4l2 + "trigger_control = \"1\"\ngain_db = 3")),
              HasSubstr("gain_db: a V4L2 gain has no unit"));
}

std::string with_sound(const std::string& fields) {
  return std::string(kGood) + "[[sound]]\nnode = \"cap01\"\n" + fields;
}

TEST(StudioFile, reads_the_sound_input_of_a_node) {
  const Studio studio = parse_studio(
      with_sound("device = \"hw:CARD=USB\"\nchannels = 4\nrate_hz = 96000\npulse_channel = 3\n"
                 "timecode_channel = 4\ntimecode_rate = \"29.97df\""),
      "studio.toml");
  const StudioSound* const sound = studio.sound_of("cap01");
  ASSERT_NE(sound, nullptr);
  EXPECT_EQ(sound->device, "hw:CARD=USB");
  EXPECT_EQ(sound->channels, 4);
  EXPECT_EQ(sound->rate_hz, 96'000);
  EXPECT_EQ(sound->pulse_channel, 3);
  EXPECT_EQ(sound->timecode_channel, 4);
  EXPECT_EQ(sound->timecode_rate, "29.97df");
  EXPECT_EQ(studio.sound_of("recon01"), nullptr);
}

std::string with_output(const std::string& fields) {
  return std::string(kGood) + "[timecode_output]\n" + fields;
}

TEST(StudioFile, reads_the_output_of_timecode) {
  const auto read = [](const std::string& text) {
    return parse_studio(text, "studio.toml").timecode_output;
  };
  EXPECT_FALSE(read(std::string(kGood)));
  const auto defaults = read(with_output("device = \"hw:CARD=USB\"\n"));
  ASSERT_TRUE(defaults);
  EXPECT_EQ(defaults->timecode_rate, "25");
  EXPECT_EQ(defaults->start, "") << "time of day";
  const auto output =
      read(with_output("device = \"hw:CARD=USB\"\nchannels = 1\nrate_hz = 96000\n"
                       "timecode_rate = \"29.97df\"\nstart = \"10:01:00;02\"\n"));
  ASSERT_TRUE(output);
  EXPECT_EQ(output->device, "hw:CARD=USB");
  EXPECT_EQ(output->channels, 1);
  EXPECT_EQ(output->rate_hz, 96'000);
  EXPECT_EQ(output->timecode_rate, "29.97df");
  EXPECT_EQ(output->start, "10:01:00;02");
}

TEST(StudioFile, rejects_invalid_fields_of_the_output_of_timecode) {
  const std::string device = "device = \"null\"\n";
  EXPECT_THAT(message_for(with_output("")), HasSubstr("timecode_output.device: missing"));
  EXPECT_THAT(message_for(with_output(device + "timecode_rate = \"auto\"")),
              HasSubstr("timecode_output.timecode_rate: 'auto' is unknown; known: 24, 25"));
  for (const std::string start :
       {"10:00:00", "24:00:00:00", "10:00:00:25", "10:00:00;00", "noon"}) {
    EXPECT_THAT(message_for(with_output(device + "start = \"" + start + "\"")),
                HasSubstr("timecode_output.start: expected \"time of day\" or a timecode of 25"))
        << start;
  }
  EXPECT_THAT(message_for(with_output(device + "timecode_rate = \"29.97df\"\n"
                                               "start = \"10:01:00;00\"")),
              HasSubstr("as 10:00:00;00"))
      << "a number that is dropped";
}

TEST(StudioFile, rejects_invalid_fields_of_a_sound_input) {
  const std::string device = "device = \"hw:0\"\n";
  EXPECT_THAT(message_for(with_sound("")), HasSubstr("sound.device: missing"));
  EXPECT_THAT(message_for(with_sound(device + "rate_hz = 22050")),
              HasSubstr("sound.rate_hz: expected 48000, 96000 or 44100, found 22050"));
  EXPECT_THAT(message_for(with_sound(device + "pulse_channel = 3")),
              HasSubstr("sound.pulse_channel: expected a whole number from 1 to 2, found 3"));
  EXPECT_THAT(message_for(with_sound(device + "pulse_channel = 2\ntimecode_channel = 2")),
              HasSubstr("sound.timecode_channel: is also the pulse_channel"));
  EXPECT_THAT(
      message_for(with_sound(device + "timecode_rate = \"23\"")),
      HasSubstr("sound.timecode_rate: '23' is unknown; known: 24, 25, 29.97, 29.97df, 30, auto"));
  EXPECT_THAT(message_for(with_sound(device + "[[sound]]\nnode = \"cap01\"\n" + device)),
              HasSubstr("two tables [[sound]] are of node 'cap01'"));
}

}  // namespace
}  // namespace v3d
