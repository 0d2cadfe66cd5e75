// AravisCamera with the simulated camera of Aravis, in one process.
#include "capture/cameras/aravis_camera.h"

#include <arv.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <memory>
#include <string>

#include "base/core/error.h"
#include "capture/cameras/camera.h"
#include "capture/fake_camera.h"
#include "sim/cameras/gige_cameras.h"
#include "support/child_process.h"
#include "support/control_relay.h"
#include "support/message_of.h"
#include "support/temporary_folder.h"

namespace v3d::capture {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;
using testing::AllOf;
using testing::HasSubstr;

MonotonicInstant in(Duration d) { return Monotonic::now() + d; }

TEST(AravisCamera, writes_the_settings_into_the_camera) {
  const FakeCamera fake;
  ASSERT_TRUE(fake.running());
  AravisCamera camera(settings());
  camera.start();
  EXPECT_EQ(fake.read(ARV_FAKE_CAMERA_REGISTER_EXPOSURE_TIME_US), 2500U);
  EXPECT_EQ(fake.read(ARV_FAKE_CAMERA_REGISTER_GAIN_RAW), 3U);
  EXPECT_EQ(fake.read(ARV_FAKE_CAMERA_REGISTER_PIXEL_FORMAT), 0x01080001U);
  EXPECT_EQ(fake.read(ARV_FAKE_CAMERA_REGISTER_TRIGGER_MODE), 1U);
  EXPECT_EQ(fake.read(0x0d04) & 0xffff, 8000U);  // GVSP packet size
  EXPECT_EQ(camera.size(), (ImageSize{512, 512}));
  EXPECT_EQ(camera.format(), PixelFormat::kMono8);
  camera.stop();
  camera.stop();
  EXPECT_EQ(fake.read(ARV_FAKE_CAMERA_REGISTER_ACQUISITION), 0U);
}

TEST(AravisCamera, finds_the_camera_by_its_serial_number) {
  const FakeCamera fake;
  StudioCamera wanted = settings();
  wanted.address = "V3D-0001";
  AravisCamera camera(wanted);
  const auto starts = [&] {
    try {
      camera.start();
      return true;
    } catch (const InputError&) {  // a busy host may answer later than the search waits, 1 s
      return false;
    }
  };
  ASSERT_TRUE(test::becomes_true(starts, test::within(60)));
  EXPECT_EQ(camera.size(), (ImageSize{512, 512}));
}

TEST(AravisCamera, receives_one_frame_for_every_trigger) {
  const FakeCamera fake;
  const PulseTimes none(seconds(1));
  const auto camera = make_camera(settings(), none);
  camera->start();
  EXPECT_FALSE(camera->wait(in(milliseconds(300)))) << "a frame without a trigger";
  std::optional<CameraFrame> before;
  int damaged = 0;
  for (int pulse = 0; pulse < 200; ++pulse) {  // the block number wraps at 135
    fake.trigger();
    const auto frame = camera->wait(in(seconds(10)));
    if (!frame) {  // a busy host may stop the fake camera for 400 ms within a frame
      ASSERT_EQ(camera->statistics().damaged, ++damaged) << pulse;
      before.reset();
      continue;
    }
    EXPECT_EQ(frame->image.size, (ImageSize{512, 512}));
    EXPECT_EQ(frame->image.bytes.size(), 512U * 512U);
    if (before) {
      EXPECT_EQ(frame->counter, before->counter + 1) << pulse;
      EXPECT_GT(frame->device_time, before->device_time);
    }
    before = frame;
  }
  EXPECT_FALSE(camera->wait(in(milliseconds(300)))) << "a second frame for one trigger";
  EXPECT_EQ(camera->statistics().completed, 200 - damaged);
  EXPECT_EQ(camera->statistics().damaged, damaged);
  EXPECT_LT(damaged, 5);
}

TEST(AravisCamera, receives_through_a_plain_socket_if_configured) {
  const FakeCamera fake;
  fake.write(ARV_FAKE_CAMERA_REGISTER_HEIGHT, 128);  // a frame that fits the default socket buffer
  StudioCamera wanted = settings();
  wanted.packet_socket = false;
  AravisCamera camera(wanted);
  camera.start();
  fake.trigger();
  EXPECT_TRUE(camera.wait(in(seconds(10))));
}

TEST(AravisCamera, starts_again_after_a_stop) {
  const FakeCamera fake;
  AravisCamera camera(settings());
  for (int round = 0; round < 3; ++round) {
    camera.start();
    fake.trigger();
    EXPECT_TRUE(camera.wait(in(seconds(10))));
    camera.stop();
    EXPECT_FALSE(camera.wait(in(milliseconds(1))));
  }
}

TEST(AravisCamera, numbers_the_blocks_of_gige_vision_from_1) {
  const FakeCamera fake;
  AravisCamera camera(settings());
  EXPECT_EQ(camera.first_counter(), std::nullopt) << "not started";
  camera.start();
  EXPECT_EQ(camera.first_counter(), FrameCounter().unwrap(1));
}

TEST(AravisCamera, names_the_camera_and_the_rejected_setting) {
  const FakeCamera fake;
  StudioCamera wanted = settings();
  wanted.trigger_line = "Line7";
  EXPECT_THAT(start_error(wanted),
              AllOf(HasSubstr("cam07"), HasSubstr("TriggerSource: expected Line7")));
  wanted = settings();
  wanted.gain_db = 1.5;
  EXPECT_THAT(start_error(wanted),
              AllOf(HasSubstr("Gain (dB): expected 1.5"), HasSubstr("found 1")));
}

TEST(AravisCamera, rejects_a_falling_edge_trigger_that_the_camera_lacks) {
  const FakeCamera fake;
  StudioCamera wanted = settings();
  wanted.trigger_edge = Edge::kFalling;
  EXPECT_THAT(start_error(wanted), HasSubstr("TriggerActivation: expected FallingEdge"));
}

TEST(AravisCamera, follows_ptp_and_reports_the_clock_offset) {
  const test::TemporaryFolder folder;
  const std::string description = folder / "genicam.xml";
  std::ofstream(description) << sim::genicam_xml();
  const FakeCamera fake(description.c_str());
  constexpr uint32_t kPtpEnable = 0x310;
  constexpr uint32_t kPtpOffset = 0x318;
  fake.write(kPtpOffset, 1500);
  StudioCamera wanted = settings();
  wanted.trigger_line = "Line1";
  AravisCamera plain(wanted);
  plain.start();
  EXPECT_EQ(fake.read(kPtpEnable), 0U);
  plain.stop();
  wanted.ptp = true;
  AravisCamera camera(wanted);
  camera.start();
  EXPECT_EQ(fake.read(kPtpEnable), 1U);
  camera.wait(in(milliseconds(1)));
  EXPECT_EQ(camera.statistics().ptp_offset, std::chrono::nanoseconds(1500));
  fake.write(kPtpEnable, 0);
  const auto deadline = in(seconds(20));
  while (camera.statistics().ptp_offset && Monotonic::now() < deadline)
    camera.wait(in(milliseconds(50)));
  EXPECT_FALSE(camera.statistics().ptp_offset) << "the clock is no longer synchronised";
}

constexpr uint32_t kTemperature = 0x330, kWhiteBalanceAuto = 0x344, kGammaEnable = 0x348,
                   kBlackLevel = 0x34c, kLineSelector = 0x350, kLineMode = 0x388,
                   kLineSource = 0x390, kUserSet = 0x35c, kUserSetLoad = 0x360, kReverseX = 0x33c,
                   kReverseY = 0x340, kBinningHorizontal = 0x334, kBinningVertical = 0x338,
                   kGamma = 0x380, kExposureAuto = 0x1e0, kGainAuto = 0x114,
                   kBlackLevelAuto = 0x384;
/// Offset of the registers of the second line.
constexpr uint32_t kLine2 = 4;

TEST(AravisCamera, switches_off_what_changes_the_pictures_by_itself) {
  const SimulatedCamera sim;
  AravisCamera camera(SimulatedCamera::settings());
  for (int opened = 0; opened < 2; ++opened) {
    for (const uint32_t automatic : {kExposureAuto, kWhiteBalanceAuto, kBlackLevelAuto}) {
      sim.fake.write(automatic, 1);
    }
    sim.fake.write(kGainAuto, 2);
    sim.fake.write(kGammaEnable, 1);
    sim.fake.write(kGamma, 45);
    sim.fake.write(kReverseX, 1);
    camera.start();
    for (const uint32_t automatic : {kExposureAuto, kWhiteBalanceAuto, kBlackLevelAuto}) {
      EXPECT_EQ(sim.fake.read(automatic), 0U) << std::hex << automatic;
    }
    EXPECT_EQ(sim.fake.read(kGainAuto), 1U);
    EXPECT_EQ(sim.fake.read(kGammaEnable), 0U);
    EXPECT_EQ(sim.fake.read(kGamma), 100U);
    EXPECT_EQ(sim.fake.read(kReverseX), 0U) << "the studio file does not mirror";
  }
}

TEST(AravisCamera, writes_black_level_strobe_user_set_and_free_features) {
  const SimulatedCamera sim;
  StudioCamera wanted = SimulatedCamera::settings();
  wanted.black_level = 4.5;
  wanted.strobe_line = "Line2";
  wanted.user_set = "UserSet1";
  wanted.reverse_x = true;
  wanted.features = {{"LineSelector", "Line1"}, {"GammaEnable", "true"}};
  AravisCamera camera(wanted);
  camera.start();
  EXPECT_EQ(sim.fake.read(kBlackLevel), 45U);
  EXPECT_EQ(sim.fake.read(kLineMode + kLine2), 1U);
  EXPECT_EQ(sim.fake.read(kLineSource + kLine2), 1U);
  EXPECT_EQ(sim.fake.read(kUserSet), 1U);
  EXPECT_EQ(sim.fake.read(kUserSetLoad), 1U);
  EXPECT_EQ(sim.fake.read(kReverseX), 1U);
  EXPECT_EQ(sim.fake.read(kLineSelector), 0U) << "free features come after the strobe output";
  EXPECT_EQ(sim.fake.read(kGammaEnable), 1U) << "free features come after the defaults";
  EXPECT_TRUE(camera.differences().empty());
}

TEST(AravisCamera, writes_features_of_both_lines) {
  const SimulatedCamera sim;
  sim.fake.write(kLineSource + kLine2, 1);
  StudioCamera wanted = SimulatedCamera::settings();
  wanted.features = {{"LineSelector", "Line1"},
                     {"LineSource", "ExposureActive"},
                     {"LineSelector", "Line2"},
                     {"LineSource", "Off"}};
  AravisCamera camera(wanted);
  camera.start();
  EXPECT_EQ(sim.fake.read(kLineSource), 1U);
  EXPECT_EQ(sim.fake.read(kLineSource + kLine2), 0U);
  EXPECT_TRUE(camera.differences().empty());
}

TEST(AravisCamera, writes_binning_and_mirroring_and_reads_them_back) {
  const SimulatedCamera sim;
  sim.fake.write(kReverseY, 1);
  StudioCamera wanted = SimulatedCamera::settings();
  AravisCamera plain(wanted);
  plain.start();
  EXPECT_EQ(sim.fake.read(kBinningHorizontal), 1U);
  EXPECT_EQ(sim.fake.read(kReverseY), 0U) << "the studio file does not mirror";
  plain.stop();
  wanted.binning = 2;
  wanted.reverse_y = true;
  AravisCamera camera(wanted);
  camera.start();
  EXPECT_EQ(sim.fake.read(kBinningHorizontal), 2U);
  EXPECT_EQ(sim.fake.read(kBinningVertical), 2U);
  EXPECT_EQ(sim.fake.read(kReverseX), 0U);
  EXPECT_EQ(sim.fake.read(kReverseY), 1U);
  EXPECT_TRUE(camera.differences().empty());
}

/// GenICam description of the simulated camera. What is written to BinningVertical and ReverseY has
/// no effect: their values stay 1 and false.
std::string genicam_that_ignores() {
  std::string xml = sim::genicam_xml();
  for (const std::string feature : {"BinningVertical", "ReverseY"}) {
    const std::string value = "<pValue>" + feature + "Register</pValue>";
    const std::string constant = feature == "ReverseY" ? "0" : "1";
    xml.replace(xml.find(value), value.size(), "<pValue>" + feature + "Constant</pValue>");
    const std::string last = "</RegisterDescription>";
    xml.replace(xml.find(last), last.size(),
                "<IntConverter Name='" + feature + "Constant'><FormulaTo>FROM * 0 + " + constant +
                    "</FormulaTo><FormulaFrom>TO * 0 + " + constant + "</FormulaFrom><pValue>" +
                    feature + "Register</pValue></IntConverter>" + last);
  }
  return xml;
}

TEST(AravisCamera, lists_ignored_binning_and_mirroring) {
  const test::TemporaryFolder folder;
  const std::string description = folder / "genicam.xml";
  std::ofstream(description) << genicam_that_ignores();
  const FakeCamera fake(description.c_str());
  StudioCamera wanted = SimulatedCamera::settings();
  wanted.binning = 2;
  wanted.reverse_y = true;
  AravisCamera camera(wanted);
  camera.start();
  EXPECT_THAT(camera.differences(),
              testing::ElementsAre(SettingDifference{"BinningVertical", "2", "1"},
                                   SettingDifference{"ReverseY", "true", "false"}));
  EXPECT_EQ(fake.read(kBinningHorizontal), 2U);
}

TEST(AravisCamera, lists_what_the_camera_did_otherwise_than_asked) {
  const SimulatedCamera sim;
  StudioCamera wanted = SimulatedCamera::settings();
  wanted.gain_db = 3.0051;  // its steps are 0.01 dB
  wanted.features = {{"BlackLevel", "7"}, {"BalanceWhiteAuto", "Sometimes"}};
  AravisCamera camera(wanted);
  camera.start();
  const auto differs = [&](const std::string& setting) -> std::optional<SettingDifference> {
    for (const SettingDifference& d : camera.differences()) {
      if (d.setting == setting) return d;
    }
    return std::nullopt;
  };
  EXPECT_TRUE(differs("Gain (dB)").value().rounded);
  EXPECT_EQ(differs("BalanceWhiteAuto").value(),
            (SettingDifference{"BalanceWhiteAuto", "Sometimes", "Off"}));
  EXPECT_FALSE(differs("BlackLevel"));
  camera.stop();
  wanted.features = {{"BlakLevel", "7"}};
  EXPECT_THAT(start_error(wanted), AllOf(HasSubstr("cam07: BlakLevel: expected 7"),
                                         HasSubstr("a camera without this feature")));
}

TEST(AravisCamera, reports_model_firmware_and_temperature) {
  const SimulatedCamera sim;
  sim.fake.write(kTemperature, 4150);
  AravisCamera camera(SimulatedCamera::settings());
  camera.start();
  EXPECT_FALSE(camera.device().firmware.empty());
  EXPECT_THAT(camera.device().text(), HasSubstr(", firmware " + camera.device().firmware));
  camera.wait(in(milliseconds(1)));
  ASSERT_TRUE(camera.statistics().temperature_celsius);
  EXPECT_NEAR(*camera.statistics().temperature_celsius, 41.5, 0.01);
}

TEST(AravisCamera, receives_frames_while_the_camera_does_not_answer_about_its_temperature) {
  const SimulatedCamera sim;
  sim.fake.write(ARV_FAKE_CAMERA_REGISTER_HEIGHT, 128);  // fits the default socket buffer
  test::ControlRelay relay;
  StudioCamera wanted = SimulatedCamera::settings();
  wanted.address = test::ControlRelay::kAddress;
  wanted.packet_socket = false;  // its filter expects images from the relay's address
  AravisCamera camera(wanted);
  camera.start();
  relay.drop_reads_of(kTemperature);
  const auto deadline = in(seconds(60));
  while (relay.dropped() < 4 && Monotonic::now() < deadline) {
    const int before = relay.dropped();
    sim.fake.trigger();
    ASSERT_TRUE(camera.wait(in(seconds(10))));
    // Aravis asks six times. A busy host may lose the time of three.
    if (before % 6 >= 3) continue;
    ASSERT_LT(relay.dropped(), before - before % 6 + 6) << "the frame waited for the answer";
  }
  EXPECT_GE(relay.dropped(), 4);
}

TEST(AravisCamera, reads_a_region_of_the_sensor) {
  const FakeCamera fake;
  StudioCamera wanted = settings();
  wanted.size = ImageSize{256, 128};
  wanted.offset_x = 64;
  wanted.offset_y = 32;
  AravisCamera camera(wanted);
  camera.start();
  EXPECT_EQ(camera.size(), (ImageSize{256, 128}));
  fake.trigger();
  const auto frame = camera.wait(in(seconds(10)));
  ASSERT_TRUE(frame);
  EXPECT_EQ(frame->image.bytes.size(), 256U * 128);
}

TEST(AravisCamera, rejects_a_camera_without_the_configured_ptp_or_chunk_data) {
  const FakeCamera fake;
  StudioCamera wanted = settings();
  wanted.ptp = true;
  EXPECT_THAT(start_error(wanted), HasSubstr("ptp: expected PtpEnable, found a camera without it"));
  wanted = settings();
  wanted.chunk_data = true;
  EXPECT_THAT(start_error(wanted), HasSubstr("chunk_data: expected ChunkModeActive"));
}

TEST(AravisCamera, rejects_a_camera_while_another_program_controls_it) {
  const FakeCamera fake;
  AravisCamera first(settings());
  first.start();
  EXPECT_THAT(start_error(settings()), AllOf(HasSubstr("cam07"), HasSubstr("another program")));
  first.stop();
  AravisCamera second(settings());
  EXPECT_NO_THROW(second.start());
}

TEST(AravisCamera, restarts_a_camera_that_still_streams_to_a_crashed_program) {
  const FakeCamera fake;
  AravisCamera camera(settings());
  fake.write(ARV_FAKE_CAMERA_REGISTER_ACQUISITION, 1);
  fake.write(0x0d00, 1);  // GevSCPHostPort: a closed port
  camera.start();
  fake.trigger();
  EXPECT_TRUE(camera.wait(in(seconds(5))));
}

TEST(AravisCamera, lists_the_cameras_found_if_the_serial_number_is_unknown) {
  const FakeCamera fake;
  StudioCamera wanted = settings();
  wanted.address = "V3D-9999";
  std::string error;
  const auto lists_camera = [&] {  // a busy host may answer later than the search waits, 1 s
    error = start_error(wanted);
    return error.find("V3D-0001") != std::string::npos;
  };
  EXPECT_TRUE(test::becomes_true(lists_camera, test::within(60))) << error;
  EXPECT_THAT(error, AllOf(HasSubstr("cam07"), HasSubstr("V3D-9999")));
}

TEST(AravisCamera, reports_an_address_that_does_not_answer) {
  EXPECT_THAT(start_error(settings()), AllOf(HasSubstr("cam07"), HasSubstr("127.0.0.11")));
}

TEST(AravisCamera, detects_a_disconnect_and_opens_the_camera_again) {
  FakeCamera fake;
  AravisCamera camera(settings());
  camera.start();
  EXPECT_FALSE(camera.lost());
  fake.unplug();
  const auto deadline = in(seconds(60));
  while (!camera.lost() && Monotonic::now() < deadline) camera.wait(in(milliseconds(100)));
  EXPECT_TRUE(camera.lost());
  camera.stop();
  const FakeCamera again;
  camera.start();
  EXPECT_FALSE(camera.lost());
  again.trigger();
  EXPECT_TRUE(camera.wait(in(seconds(10))));
}

}  // namespace
}  // namespace v3d::capture
