#include "v3dctl/setup/doctor.h"

#include <arpa/inet.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/socket.h>

#include <algorithm>
#include <cerrno>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <thread>

#include "base/config/calib_file.h"
#include "support/child_process.h"
#include "support/temporary_folder.h"
#include "support/without_rights.h"
#include "wire/member_list.h"
#include "wire/secret_keys.h"

namespace v3d::ctl {
namespace {

using testing::HasSubstr;
using Verdict = Finding::Verdict;

TEST(Doctor, requires_a_receive_buffer_for_a_burst_of_frames) {
  EXPECT_EQ(check_receive_buffer(212992).verdict, Verdict::kBad);
  EXPECT_NE(check_receive_buffer(212992).remedy.find("sysctl"), std::string::npos);
  EXPECT_EQ(check_receive_buffer(33554432).verdict, Verdict::kGood);
  EXPECT_EQ(check_receive_buffer(-1).verdict, Verdict::kUnknown);
}

/// A host on which the timer of cycle i fires late by delays[i].
class DelayedHost {
 public:
  explicit DelayedHost(std::vector<Duration> delays) : delays_(std::move(delays)) {}
  HostClock clock() {
    return {.now = [this] { return now_; },
            .sleep_until =
                [this](MonotonicInstant due) { now_ = std::max(now_, due) + delays_.at(next_++); }};
  }

 private:
  std::vector<Duration> delays_;
  size_t next_ = 0;
  MonotonicInstant now_{std::chrono::hours(1)};
};

TEST(Doctor, measures_how_late_each_timer_wakes) {
  using std::chrono::microseconds;
  const std::vector<Duration> delays = {microseconds(5), microseconds(900), microseconds(2500),
                                        microseconds(7)};
  DelayedHost host(delays);
  EXPECT_EQ(measure_wakeups(host.clock(), 4, std::chrono::milliseconds(1)), delays);
}

TEST(Doctor, compares_the_latest_timer_with_a_tenth_of_the_period_of_the_pulses) {
  std::vector<Duration> lateness(10'000, std::chrono::microseconds(10));
  std::fill_n(lateness.begin(), 150, std::chrono::microseconds(80));
  lateness.back() = std::chrono::microseconds(4100);
  const Duration limit = max_pulse_lateness(std::chrono::milliseconds(40));
  const Finding late = judge_wakeups(lateness, true, limit);
  EXPECT_EQ(late.verdict, Verdict::kBad);
  EXPECT_NE(late.remedy, "");
  const std::vector<std::pair<std::string, double>> values = {
      {"cycles", 10'000},       {"lateness_p50_us", 10},   {"lateness_p99_us", 80},
      {"lateness_p999_us", 80}, {"lateness_max_us", 4100}, {"limit_us", 4000},
      {"realtime_flag", 1}};
  EXPECT_EQ(late.values, values);
  EXPECT_EQ(judge_wakeups(lateness, false, limit).verdict, Verdict::kUnknown)
      << "not measured at the priority of the trigger";
  lateness.back() = limit;
  EXPECT_EQ(judge_wakeups(lateness, true, limit).verdict, Verdict::kGood);
  EXPECT_EQ(judge_wakeups(lateness, false, limit).verdict, Verdict::kGood);
}

TEST(Doctor, names_a_missing_folder_of_takes) {
  const Finding finding = check_disk("/not/there");
  EXPECT_EQ(finding.verdict, Verdict::kBad);
  EXPECT_NE(finding.text.find("/not/there"), std::string::npos);
}

TEST(Doctor, has_no_verdict_about_a_bus_that_is_not_udp) {
  EXPECT_EQ(check_multicast("memq://").verdict, Verdict::kUnknown);
}

TEST(Doctor, reports_sound_whose_pulses_have_no_times) {
  Studio studio;
  studio.trigger.node = "cap01";
  studio.sounds = {{.node = "cap01", .device = "null", .timecode_rate = {}},
                   {.node = "cap02", .device = "null", .timecode_rate = {}}};
  studio.trigger.kind = TriggerKind::kGpio;
  EXPECT_EQ(check_sound_devices(studio, "cap01").size(), 1U) << "its PC paces the pulses";
  ASSERT_EQ(check_sound_devices(studio, "cap02").size(), 2U);
  EXPECT_EQ(check_sound_devices(studio, "cap02")[1].verdict, Verdict::kBad);
  EXPECT_THAT(check_sound_devices(studio, "cap02")[1].text, HasSubstr("is not sensed"));
  studio.trigger.kind = TriggerKind::kScpi;
  EXPECT_EQ(check_sound_devices(studio, "cap01").size(), 2U);
  studio.trigger.sense = StudioLine{.chip = "gpiochip0", .line = "SENSE"};
  EXPECT_EQ(check_sound_devices(studio, "cap01").size(), 1U);
}

TEST(Doctor, opens_the_sound_devices_of_a_node) {
  Studio studio;
  studio.trigger.node = "cap01";
  studio.sounds = {{.node = "cap01", .device = "null", .timecode_rate = {}},
                   {.node = "cap02", .device = "hw:CARD=NoSuchCard", .timecode_rate = {}}};
  studio.timecode_output = {.device = "null", .start = ""};
  const auto good = check_sound_devices(studio, "cap01");
  ASSERT_EQ(good.size(), 2U);
  EXPECT_EQ(good[0].verdict, Verdict::kGood) << good[0].text;
  EXPECT_EQ(good[1].subject, "timecode output");
  EXPECT_EQ(good[1].verdict, Verdict::kGood) << good[1].text;
  const auto bad = check_sound_devices(studio, "cap02");
  ASSERT_EQ(bad.size(), 1U);
  EXPECT_EQ(bad[0].verdict, Verdict::kBad);
  EXPECT_NE(bad[0].text.find("NoSuchCard"), std::string::npos);
  EXPECT_FALSE(bad[0].remedy.empty());
  EXPECT_EQ(check_sound_devices(studio, "")[1].verdict, Verdict::kUnknown) << "on another PC";
}

TEST(Doctor, asks_olad_on_the_pc_that_switches_the_lamps) {
  Studio studio;
  EXPECT_FALSE(check_lights(studio, "cap01"));
  studio.lights = {.node = "cap01", .work = {255}, .take = {0}};
  EXPECT_FALSE(check_lights(studio, "cap02")) << "on another PC";
  const test::TemporaryFolder folder;
  const std::string path = getenv("PATH");
  setenv("PATH", folder.path().c_str(), 1);
  const auto missing = check_lights(studio, "cap01");
  const auto answers = [&](const std::string& script) {
    std::ofstream(folder / "v3d-lights") << "#!/bin/sh\n" << script;
    std::filesystem::permissions(folder / "v3d-lights", std::filesystem::perms::owner_all);
    return check_lights(studio, "cap01");
  };
  const auto good = answers("echo connected\n"), bad = answers("echo no olad >&2\nexit 1\n");
  setenv("PATH", path.c_str(), 1);
  ASSERT_TRUE(missing && good && bad);
  EXPECT_EQ(missing->verdict, Verdict::kBad);
  EXPECT_EQ(missing->text, "v3d-lights is not installed");
  EXPECT_EQ(good->verdict, Verdict::kGood);
  EXPECT_EQ(bad->verdict, Verdict::kBad);
  EXPECT_EQ(bad->text, "no olad");
}

TEST(Doctor, has_a_remedy_for_a_camera_that_does_not_reply) {
  StudioCamera camera;
  camera.name = "cam01";
  camera.address = "127.0.0.1";  // no process receives there
  const auto findings = check_cameras({camera});
  ASSERT_EQ(findings.size(), 1U);
  EXPECT_EQ(findings[0].verdict, Verdict::kBad);
  EXPECT_FALSE(findings[0].remedy.empty());
}

// A camera's control port on a loopback address of its own: acknowledges register reads.
class FakeControlPort {
 public:
  explicit FakeControlPort(const char* address)
      : fd_(socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0)) {
    sockaddr_in here{};
    here.sin_family = AF_INET;
    here.sin_port = htons(3956);
    inet_pton(AF_INET, address, &here.sin_addr);
    bound_ = bind(fd_, reinterpret_cast<const sockaddr*>(&here), sizeof here) == 0;
    if (bound_) thread_ = std::thread([this] { answer(); });
  }
  ~FakeControlPort() {
    shutdown(fd_, SHUT_RDWR);
    if (thread_.joinable()) thread_.join();
    close(fd_);
  }
  bool bound() const { return bound_; }

 private:
  void answer() {
    uint8_t command[64];
    sockaddr_in from{};
    socklen_t size = sizeof from;
    while (recvfrom(fd_, command, sizeof command, 0, reinterpret_cast<sockaddr*>(&from), &size) >=
           8) {
      const uint8_t ack[] = {0, 0, 0, 0x81, 0, 4, command[6], command[7], 0, 2, 0, 0};
      sendto(fd_, ack, sizeof ack, 0, reinterpret_cast<const sockaddr*>(&from), size);
    }
  }

  int fd_;
  bool bound_ = false;
  std::thread thread_;
};

TEST(Doctor, finds_a_camera_that_replies) {
  const FakeControlPort port("127.0.1.77");
  if (!port.bound()) GTEST_SKIP() << "127.0.1.77:3956 is taken on this machine";
  StudioCamera camera;
  camera.name = "cam01";
  camera.address = "127.0.1.77";
  const auto is_found = [&] { return check_cameras({camera})[0].verdict == Verdict::kGood; };
  EXPECT_TRUE(test::becomes_true(is_found, test::within(60))) << "a busy host may reply late";
}

TEST(Doctor, names_a_v4l2_camera_that_is_not_connected) {
  StudioCamera camera;
  camera.name = "cam01";
  camera.kind = CameraKind::kV4l2;
  camera.address = "NO-SUCH-SERIAL";
  const auto findings = check_cameras({camera});
  ASSERT_EQ(findings.size(), 1U);
  EXPECT_EQ(findings[0].verdict, Verdict::kBad);
  EXPECT_NE(findings[0].text.find("NO-SUCH-SERIAL"), std::string::npos) << findings[0].text;
  EXPECT_NE(findings[0].remedy.find("/dev/v4l/by-id"), std::string::npos);
}

TEST(Doctor, shows_firmware_and_ignored_settings_of_the_cameras_on_this_pc) {
  const test::TemporaryFolder folder;
  Studio studio;
  studio.storage.takes = folder.path();
  StudioCamera camera;
  camera.name = "cam01";
  camera.node = "cap01";
  EXPECT_TRUE(check_camera_settings(studio, {camera}).empty()) << "no node ran here";
  std::ofstream(folder / ".camera-settings-cap01.toml")
      << "[[camera]]\nname = \"cam01\"\ndevice = \"Maker Model, firmware 1.2\"\n"
         "[[camera]]\nname = \"cam02\"\ndevice = \"Maker Model, firmware 1.1\"\n"
         "[[difference]]\ncamera = \"cam02\"\nsetting = \"GammaEnable\"\nasked = \"false\"\n"
         "got = \"true\"\nrounded = false\n"
         "[[difference]]\ncamera = \"cam01\"\nsetting = \"Gain\"\nasked = \"3.005\"\n"
         "got = \"3.0\"\nrounded = true\n";
  const auto findings = check_camera_settings(studio, {camera});
  ASSERT_EQ(findings.size(), 2U);
  EXPECT_EQ(findings[0].verdict, Verdict::kGood) << "a rounded value is accepted";
  EXPECT_NE(findings[0].text.find("firmware 1.2"), std::string::npos);
  EXPECT_EQ(findings[1].verdict, Verdict::kBad);
  EXPECT_NE(findings[1].text.find("GammaEnable (expected false, found true)"), std::string::npos);
}

TEST(Doctor, has_no_verdict_about_a_camera_with_a_serial_number) {
  StudioCamera camera;
  camera.name = "cam01";
  camera.address = "GV-4103";
  EXPECT_EQ(check_cameras({camera})[0].verdict, Verdict::kUnknown);
}

TEST(Doctor, requires_an_mtu_for_the_packets_of_the_cameras) {
  EXPECT_EQ(check_mtu("eth1", 9000, 9000).verdict, Verdict::kGood);
  const Finding finding = check_mtu("eth1", 1500, 9000);
  EXPECT_EQ(finding.verdict, Verdict::kBad);
  EXPECT_NE(finding.remedy.find("ip link set dev eth1 mtu 9000"), std::string::npos);
}

TEST(Doctor, finds_the_interface_on_the_route_to_a_camera) {
  StudioCamera camera;
  camera.address = "127.0.0.1";
  camera.packet_size = 1000;
  const auto findings = check_mtu({camera});
  ASSERT_EQ(findings.size(), 1U);
  EXPECT_EQ(findings[0].verdict, Verdict::kGood);
  EXPECT_EQ(findings[0].text.substr(0, 3), "lo ");
}

TEST(Doctor, reports_the_source_and_the_offset_of_the_clock) {
  const auto verdict = [](const std::map<std::string, double>& values, bool kernel) {
    return check_clock(values, kernel).verdict;
  };
  EXPECT_EQ(verdict({{"clock_synchronised_flag", 1}, {"clock_offset_us", -40}}, true),
            Verdict::kGood);
  EXPECT_EQ(verdict({{"clock_synchronised_flag", 1}, {"clock_offset_us", -4000}}, true),
            Verdict::kBad);
  EXPECT_EQ(verdict({{"clock_synchronised_flag", 0}}, true), Verdict::kBad);
  EXPECT_EQ(verdict({{"ptp_steps_removed", 1}, {"ptp_offset_us", 0.3}}, true), Verdict::kGood);
  EXPECT_EQ(verdict({{"ptp_steps_removed", 1}, {"ptp_offset_us", 4000}}, true), Verdict::kBad);
  EXPECT_EQ(verdict({{"ptp_steps_removed", 0}}, true), Verdict::kUnknown)
      << "the master, or a PC that has lost it";
  EXPECT_EQ(verdict({}, true), Verdict::kGood) << "perhaps by PTP";
  EXPECT_EQ(verdict({}, false), Verdict::kBad);
  EXPECT_NE(check_clock({}, false).remedy, "");
}

TEST(Doctor, reports_a_clock_without_the_time_scale_of_scheduled_action_commands) {
  StudioTrigger trigger;
  EXPECT_TRUE(check_ptp_scale(trigger, 0).empty());
  trigger.kind = TriggerKind::kAction;
  EXPECT_EQ(check_ptp_scale(trigger, 37).at(0).verdict, Verdict::kGood);
  const Finding late = check_ptp_scale(trigger, 0).at(0);
  EXPECT_EQ(late.verdict, Verdict::kBad);
  EXPECT_NE(late.remedy, "");
  trigger.action.clock = PtpScale::kUtc;
  EXPECT_EQ(check_ptp_scale(trigger, 0).at(0).verdict, Verdict::kGood);
}

TEST(Doctor, requires_a_disk_with_the_data_rate_of_the_cameras) {
  EXPECT_EQ(judge_disk_speed(500e6, 295e6, true).verdict, Verdict::kGood);
  EXPECT_EQ(judge_disk_speed(200e6, 295e6, true).verdict, Verdict::kBad);
  EXPECT_EQ(judge_disk_speed(200e6, 0, true).verdict, Verdict::kGood) << "an unknown data rate";
}

/// A calibrated camera of 200 x 100 pixels.
RigCamera calibrated(const std::string& name) {
  const Eigen::Matrix3d intrinsics = Eigen::Vector3d(200, 200, 1).asDiagonal();
  return {.name = name, .model = {{200, 100}, intrinsics, {}, {}}};
}

/// A camera with 8 bits a pixel.
StudioCamera camera_of(const std::string& node, const std::string& name) {
  StudioCamera camera;
  camera.node = node;
  camera.name = name;
  return camera;
}

TEST(Doctor, compares_the_disk_of_a_pc_with_the_cameras_of_one_node) {
  const test::TemporaryFolder folder;
  Studio studio;
  studio.storage.calib = folder / "calib.toml";
  studio.storage.takes = folder.path();
  studio.trigger.rate_hz = 25;
  studio.nodes = {{.name = "cap01"}, {.name = "cap02"}, {.name = "recon"}};
  studio.cameras = {camera_of("cap01", "a"), camera_of("cap02", "b"), camera_of("cap02", "c")};
  const double frame = 200 * 100;
  EXPECT_EQ(needed_disk_speed(studio, ""), 0) << "there is no calibration";
  save_calib(studio.storage.calib, {calibrated("a"), calibrated("b"), calibrated("c")});
  EXPECT_EQ(needed_disk_speed(studio, "cap01"), 25 * frame);
  EXPECT_EQ(needed_disk_speed(studio, "cap02"), 25 * 2 * frame);
  EXPECT_EQ(needed_disk_speed(studio, "recon"), 0);
  EXPECT_EQ(needed_disk_speed(studio, ""), 25 * 2 * frame) << "no disk gets all frames";
  const Finding slow = judge_disk_speed(1000, 25 * 2 * frame, false);
  EXPECT_EQ(slow.verdict, Verdict::kUnknown) << "this may be no PC with cameras";
  EXPECT_THAT(slow.remedy, HasSubstr("v3dctl doctor NODE"));
  EXPECT_EQ(judge_disk_speed(1e9, 25 * 2 * frame, false).verdict, Verdict::kGood);
}

/// The finding about the speed of the disk, whose cameras send more than any disk writes.
Finding speed_for_fast_cameras(Studio studio, const std::string& node) {
  const test::TemporaryFolder folder;
  studio.storage.calib = folder / "calib.toml";
  studio.storage.takes = folder.path();
  studio.trigger.rate_hz = 1e12;
  Rig rig;
  for (const StudioCamera& camera : studio.cameras) rig.push_back(calibrated(camera.name));
  save_calib(studio.storage.calib, rig);
  const auto findings = check_machine(studio, node);
  return *std::ranges::find(findings, "disk speed", &Finding::subject);
}

TEST(Doctor, judges_the_disk_without_a_node_only_where_one_node_has_cameras) {
  Studio studio;
  studio.nodes = {{.name = "cap01"}, {.name = "cap02"}};
  studio.cameras = {camera_of("cap01", "a"), camera_of("cap02", "b")};
  EXPECT_EQ(speed_for_fast_cameras(studio, "").verdict, Verdict::kUnknown);
  EXPECT_EQ(speed_for_fast_cameras(studio, "cap02").verdict, Verdict::kBad);
  studio.cameras.pop_back();
  EXPECT_EQ(speed_for_fast_cameras(studio, "").verdict, Verdict::kBad);
}

TEST(Doctor, measures_the_disk_and_removes_its_file) {
  const test::TemporaryFolder folder;
  EXPECT_EQ(check_disk_speed(folder.path(), 1, true).verdict, Verdict::kGood);
  EXPECT_TRUE(std::filesystem::is_empty(folder.path()));
  EXPECT_EQ(check_disk_speed("/not/there", 1, true).verdict, Verdict::kUnknown);
}

TEST(Doctor, names_a_disk_that_cannot_be_written_as_a_fault) {
  for (const int code : {EROFS, EIO, ENOSPC, EDQUOT}) {
    const Finding finding = judge_disk_error({.code = code, .message = "cannot create x"});
    EXPECT_EQ(finding.verdict, Verdict::kBad) << code;
    EXPECT_EQ(finding.text, "cannot create x");
    EXPECT_THAT(finding.remedy, HasSubstr("cannot be written"));
  }
  for (const int code : {EACCES, EPERM}) {
    const Finding finding = judge_disk_error({.code = code, .message = "cannot create x"});
    EXPECT_EQ(finding.verdict, Verdict::kUnknown) << code;
    EXPECT_THAT(finding.remedy, HasSubstr("group v3d"));
  }
}

TEST(Doctor, checks_the_memory_of_usb_only_with_usb_cameras) {
  Studio studio;
  studio.nodes = {{.name = "cap01"}, {.name = "recon"}};
  studio.cameras = {camera_of("cap01", "a")};
  studio.cameras[0].address = "GV-4103";
  EXPECT_EQ(check_usb_memory(16, studio, "cap01").verdict, Verdict::kBad);
  EXPECT_EQ(check_usb_memory(16, studio, "recon").verdict, Verdict::kGood);
  EXPECT_EQ(check_usb_memory(1000, studio, "cap01").verdict, Verdict::kGood);
  EXPECT_EQ(check_usb_memory(0, studio, "cap01").verdict, Verdict::kGood) << "no limit";
  EXPECT_EQ(check_usb_memory(-1, Studio(), "").verdict, Verdict::kUnknown);
}

TEST(Doctor, judges_the_memory_of_usb_without_a_node_only_where_one_node_has_cameras) {
  Studio studio;
  studio.nodes = {{.name = "cap01"}, {.name = "cap02"}};
  studio.cameras = {camera_of("cap01", "a"), camera_of("cap02", "b")};
  studio.cameras[0].address = "GV-4103";
  studio.cameras[1].address = "203.0.113.9";
  const Finding unknown = check_usb_memory(16, studio, "");
  EXPECT_EQ(unknown.verdict, Verdict::kUnknown) << "this PC may have the node cap02";
  EXPECT_THAT(unknown.remedy, HasSubstr("v3dctl doctor NODE"));
  EXPECT_EQ(check_usb_memory(1000, studio, "").verdict, Verdict::kGood);
  EXPECT_EQ(check_usb_memory(16, studio, "cap01").verdict, Verdict::kBad);
  EXPECT_EQ(check_usb_memory(16, studio, "cap02").verdict, Verdict::kGood);
  studio.cameras.pop_back();
  EXPECT_EQ(check_usb_memory(16, studio, "").verdict, Verdict::kBad);
}

TEST(Doctor, takes_no_camera_with_an_ip_address_for_a_usb_camera) {
  StudioCamera camera;
  camera.address = "203.0.113.9";
  EXPECT_FALSE(may_have_usb_cameras({camera}));
  camera.address = "255.255.255.255";  // connect() fails, as without a route
  ASSERT_EQ(source_address_to(camera.address), 0U);
  EXPECT_FALSE(may_have_usb_cameras({camera}));
  StudioCamera other;
  other.address = "GV-4103";
  EXPECT_TRUE(may_have_usb_cameras({camera, other}));
  other.kind = CameraKind::kV4l2;
  EXPECT_FALSE(may_have_usb_cameras({camera, other}));
  EXPECT_FALSE(may_have_usb_cameras({}));
}

TEST(Doctor, requires_a_studio_key_that_only_its_owner_can_read) {
  const test::TemporaryFolder folder;
  const auto path = folder / "studio.key";
  EXPECT_EQ(check_key_file(path).verdict, Verdict::kBad);
  EXPECT_NE(check_key_file(path).remedy.find("v3dctl key new"), std::string::npos);
  wire::StudioKey::make().save(path);
  EXPECT_EQ(check_key_file(path).verdict, Verdict::kGood);
  std::filesystem::permissions(path, std::filesystem::perms(0644));
  EXPECT_EQ(check_key_file(path).remedy, "chmod 640 " + path.string());
}

TEST(Doctor, has_no_verdict_about_a_studio_key_that_this_user_may_not_read) {
  const test::TemporaryFolder folder;
  std::filesystem::permissions(folder.path(), std::filesystem::perms(0755));
  const std::filesystem::path closed = folder / "closed";
  std::filesystem::create_directory(closed);
  for (const auto& path : {folder / "studio.key", closed / "studio.key"}) {
    wire::StudioKey::make().save(path);
  }
  const auto set_modes = [&](unsigned key, unsigned of_folder) {
    std::filesystem::permissions(folder / "studio.key", std::filesystem::perms(key));
    std::filesystem::permissions(closed, std::filesystem::perms(of_folder));
  };
  set_modes(0, 0);
  std::vector<Finding> findings;
  {
    const test::WithoutRights rights;
    if (!rights.is_set()) GTEST_SKIP() << "skipped: this system does not permit another user";
    EXPECT_NO_THROW(findings.push_back(check_key_file(folder / "studio.key")));
    EXPECT_NO_THROW(findings.push_back(check_key_file(closed / "studio.key")));
  }
  set_modes(0600, 0700);  // so that the folder can be removed
  ASSERT_EQ(findings.size(), 2U);
  for (const Finding& finding : findings) {
    EXPECT_EQ(finding.verdict, Verdict::kUnknown) << finding.text;
    EXPECT_THAT(finding.text, HasSubstr("Permission denied"));
    EXPECT_THAT(finding.remedy, HasSubstr("group v3d"));
  }
}

TEST(Doctor, requires_a_member_list_with_the_signature_of_the_authority) {
  const test::TemporaryFolder folder;
  const wire::SigningKey authority = wire::SigningKey::make();
  Studio studio;
  studio.name = "kyoto";
  studio.network.members = folder / "members.toml";
  studio.network.authority = authority.public_key().text();
  EXPECT_EQ(check_member_list(studio).verdict, Verdict::kBad) << "there is none";
  const wire::MemberList list{.studio = "kyoto", .serial = 3, .members = {}};
  test::write_text(studio.network.members, sign_member_list(list, authority));
  EXPECT_EQ(check_member_list(studio).verdict, Verdict::kGood);
  EXPECT_NE(check_member_list(studio).text.find("serial number 3"), std::string::npos);
  test::write_text(studio.network.members, sign_member_list(list, wire::SigningKey::make()));
  EXPECT_EQ(check_member_list(studio).verdict, Verdict::kBad);
}

TEST(Doctor, names_the_nodes_that_have_no_key_or_another) {
  wire::HealthMessage well;
  wire::HealthMessage strange;
  strange.text = "not verified: no valid MAC or signature";
  const auto findings =
      check_keys_of({"cap01", "cap02", "cap03"}, {{"cap01", well}, {"cap02", strange}});
  ASSERT_EQ(findings.size(), 3U);
  EXPECT_EQ(findings[0].verdict, Verdict::kGood);
  EXPECT_EQ(findings[1].verdict, Verdict::kBad);
  EXPECT_EQ(findings[1].subject, "key of cap02");
  EXPECT_EQ(findings[2].verdict, Verdict::kUnknown) << "silent";
}

TEST(Doctor, checks_the_limit_of_real_time_priorities) {
  EXPECT_EQ(check_realtime(50, false).verdict, Verdict::kGood);
  EXPECT_EQ(check_realtime(0, true).verdict, Verdict::kGood);
  EXPECT_NE(check_realtime(0, false).remedy, "");
}

}  // namespace
}  // namespace v3d::ctl
