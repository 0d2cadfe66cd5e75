#include "v3dctl/operate/health_text.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "daemon/control/take_name.h"

namespace v3d::ctl {
namespace {

using testing::AllOf;
using testing::Contains;
using testing::EndsWith;
using testing::HasSubstr;
using testing::Not;
using testing::StartsWith;

const std::vector<std::string> kNodes = {"cap01", "cap02", "cap03"};

TEST(HealthText, has_the_unit_of_every_value) {
  EXPECT_EQ(value_text("disk_free_bytes", 812e9), "812 GB");
  EXPECT_EQ(value_text("disk_seconds_left", 2700), "45 min");
  EXPECT_EQ(value_text("clock_offset_us", 12.4), "+12 us");
  EXPECT_EQ(value_text("clock_error_bound_us", 12.4), "12 us");
  EXPECT_EQ(value_text("cpu_machine_percent", 34.6), "35 %");
  EXPECT_EQ(value_text("frames_per_second", 25), "25.0/s");
  EXPECT_EQ(value_text("streaming_flag", 1), "yes");
  EXPECT_EQ(value_text("frames_received", 18750), "18,750");
  EXPECT_EQ(value_text("gain", 0.125), "0.125");
}

TEST(HealthText, rounds_durations_to_one_unit) {
  EXPECT_EQ(duration_text(45), "45 s");
  EXPECT_EQ(duration_text(1200), "20 min");
  EXPECT_EQ(duration_text(9000), "2.5 h");
  EXPECT_EQ(duration_text(5e5), "6 d");
}

wire::HealthMessage health(wire::NodeState state, std::map<std::string, double> values) {
  wire::HealthMessage message;
  message.program = "v3d-captured";
  message.state = state;
  message.take = "kendo-07";
  message.values = std::move(values);
  return message;
}

TEST(HealthText, is_well_when_every_node_has_reported_and_none_has_a_fault) {
  std::map<std::string, wire::HealthMessage> reported;
  for (const std::string& node : kNodes) reported[node] = health(wire::NodeState::kIdle, {});
  EXPECT_TRUE(all_well(kNodes, reported));
  reported["cap02"].state = wire::NodeState::kFault;
  EXPECT_FALSE(all_well(kNodes, reported));
  reported.erase("cap02");
  EXPECT_FALSE(all_well(kNodes, reported));
  EXPECT_THAT(
      status_lines(kNodes, reported)[1],
      AllOf(StartsWith("cap02"), EndsWith("silent. Try: systemctl status --all 'v3d-*' on cap02")));
}

TEST(HealthText, is_summed_over_the_nodes) {
  const std::map<std::string, wire::HealthMessage> reported = {
      {"cap01",
       health(wire::NodeState::kRecording, {{"frames_missing", 2}, {"pulses_sensed", 1300}})},
      {"cap02",
       health(wire::NodeState::kRecording, {{"frames_missing", 1}, {"cam2.frames_missing", 1}})}};
  EXPECT_EQ(sum_over_nodes(reported, "frames_missing"), 3);
  EXPECT_EQ(sum_over_nodes(reported, "live_fps"), std::nullopt);
  EXPECT_EQ(recording_line(reported), "1,300 pulses   3 missing");
}

/// cap02 has restarted in the take.
std::map<std::string, wire::HealthMessage> health_without_cap02(wire::NodeState state) {
  std::map<std::string, wire::HealthMessage> reported = {
      {"cap01", health(wire::NodeState::kRecording, {{"cameras", 10}, {"cameras_streaming", 10}})},
      {"cap02", health(state, {{"cameras", 5}, {"cameras_streaming", 5}})},
      {"recon01", health(wire::NodeState::kIdle, {{"meshes", 7}})}};
  reported["cap02"].take = "";
  return reported;
}

TEST(HealthText, names_a_node_that_does_not_record_the_running_take) {
  for (const wire::NodeState state : {wire::NodeState::kIdle, wire::NodeState::kFault}) {
    const auto reported = health_without_cap02(state);
    EXPECT_EQ(recording_line(reported), "10/15 cameras   cap02 does not record");
    EXPECT_FALSE(all_well({"cap01", "cap02", "recon01"}, reported));
  }
}

TEST(HealthText, names_no_node_that_is_about_to_record_or_has_recorded) {
  for (const wire::NodeState state : {wire::NodeState::kArmed, wire::NodeState::kDraining}) {
    const auto reported = health_without_cap02(state);
    EXPECT_EQ(recording_line(reported), "15/15 cameras");
    EXPECT_TRUE(all_well({"cap01", "cap02", "recon01"}, reported));
  }
  auto idle = health_without_cap02(wire::NodeState::kIdle);
  idle["cap01"].state = wire::NodeState::kIdle;
  EXPECT_EQ(recording_line(idle), "15/15 cameras") << "nothing is recorded";
}

TEST(HealthText, has_the_same_content_as_json) {
  const Json json =
      health_json({"cap01", "cap02"}, {{"cap01", health(wire::NodeState::kIdle, {{"x", 1}})}});
  EXPECT_FALSE(json["well"].get<bool>());
  EXPECT_EQ(json["nodes"][0]["values"]["x"], 1);
  EXPECT_EQ(json["nodes"][1]["state"], "silent");
}

TEST(HealthText, says_that_a_check_records_nothing) {
  wire::HealthMessage message =
      health(wire::NodeState::kRecording, {{control::kUnrecordedFlag, 1}, {"pulses_sensed", 3}});
  message.take = "check";
  EXPECT_THAT(status_lines({"cap01"}, {{"cap01", message}}).front(),
              AllOf(EndsWith("check: nothing is recorded"), Not(HasSubstr("recording"))));
  EXPECT_EQ(health_json({"cap01"}, {{"cap01", message}})["nodes"][0]["state"], "recording")
      << "for earlier readers";
  message.values.clear();
  message.take = "kendo-07";
  EXPECT_THAT(status_lines({"cap01"}, {{"cap01", message}}).front(),
              EndsWith("recording  kendo-07"));
}

TEST(HealthText, says_that_no_service_reports_the_state_of_the_clock) {
  wire::HealthMessage message = health(wire::NodeState::kIdle, {});
  const auto lines = [&] { return health_lines({"cap01"}, {{"cap01", message}}); };
  EXPECT_THAT(lines(),
              Contains(HasSubstr("unknown: neither chronyd, systemd-timesyncd nor ptp4l")));
  message.values = {{"clock_synchronised_flag", 0}};
  EXPECT_THAT(lines(), Not(Contains(HasSubstr("unknown"))));
  message.values = {{"ptp_steps_removed", 1}};
  EXPECT_THAT(lines(), Not(Contains(HasSubstr("unknown"))));
}

TEST(HealthText, has_model_and_firmware_of_a_camera) {
  wire::HealthMessage message = health(wire::NodeState::kIdle, {});
  message.texts = {{"cam01.firmware", "1.2"}};
  EXPECT_THAT(health_lines({"cap01"}, {{"cap01", message}}),
              Contains(AllOf(HasSubstr("cam01.firmware"), HasSubstr("1.2"))));
  EXPECT_EQ(health_json({"cap01"}, {{"cap01", message}})["nodes"][0]["texts"]["cam01.firmware"],
            "1.2");
}

TEST(HealthText, has_a_column_for_a_camera_with_a_dot_in_its_name) {
  const auto lines = health_lines(
      {"cap01"}, {{"cap01", health(wire::NodeState::kIdle,
                                   {{"left.1.frames_missing", 3}, {"left.2.frames_missing", 4}})}});
  EXPECT_THAT(lines, Contains(HasSubstr("  left.1  left.2")));
  EXPECT_THAT(lines, Contains(AllOf(HasSubstr("frames_missing"), HasSubstr("3       4"))));
}

TEST(HealthText, has_a_table_of_cameras_below_the_values_of_the_node) {
  wire::HealthMessage message =
      health(wire::NodeState::kRecording, {{"disk_free_bytes", 812e9},
                                           {"cam01.frames_per_second", 25},
                                           {"cam02.frames_per_second", 25}});
  message.version = "0.1.0";
  const auto lines = health_lines({"cap01", "cap02"}, {{"cap01", message}});
  EXPECT_THAT(lines, Contains(AllOf(HasSubstr("disk_free_bytes"), HasSubstr("812 GB"))));
  EXPECT_THAT(lines, Contains(AllOf(HasSubstr("version"), HasSubstr("0.1.0"))));
  EXPECT_THAT(lines, Contains(HasSubstr("   cam01   cam02")));
  EXPECT_THAT(lines, Contains(AllOf(HasSubstr("frames_per_second"), HasSubstr("25.0/s  25.0/s"))));
  EXPECT_THAT(lines.back(), AllOf(HasSubstr("cap02"), HasSubstr("silent")));
}

}  // namespace
}  // namespace v3d::ctl
