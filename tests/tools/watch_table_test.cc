#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "v3dctl/operate/studio_monitor.h"

namespace v3d::ctl {
namespace {

using testing::AllOf;
using testing::Contains;
using testing::HasSubstr;
using testing::Not;

constexpr size_t kWide = 200;
constexpr size_t kHigh = 100;

wire::HealthMessage capture_health() {
  wire::HealthMessage health;
  health.node = "cap01";
  health.program = "v3d-captured";
  health.version = "0.1.0";
  health.state = wire::NodeState::kRecording;
  health.take = "kendo-07";
  health.values = {{"cameras", 2},
                   {"cameras_streaming", 2},
                   {"pulses_sensed", 300},
                   {"frames_missing", 0},
                   {"frames_suspect", 0},
                   {"queue_frames", 1},
                   {"disk_free_bytes", 812e9},
                   {"disk_seconds_left", 2700},
                   {"clock_synchronised_flag", 1},
                   {"clock_offset_us", -12},
                   {"cpu_machine_percent", 35},
                   {"memory_daemon_bytes", 1.2e9},
                   {"memory_available_bytes", 9e9},
                   {"temperature_max_celsius", 51}};
  for (const std::string camera : {"cam01.", "cam02."}) {
    health.values[camera + "streaming_flag"] = 1;
    health.values[camera + "frames_per_second"] = 25;
    health.values[camera + "frames_missing"] = 0;
    health.values[camera + "frames_suspect"] = 0;
    health.values[camera + "queue_frames"] = 1;
  }
  return health;
}

/// A studio without faults.
StudioSnapshot studio() {
  StudioSnapshot state;
  state.studio = "dome";
  state.nodes = {"cap01"};
  state.cameras = {{"cap01", {"cam01", "cam02"}}};
  state.health["cap01"] = capture_health();
  return state;
}

std::vector<std::string> texts(const StudioSnapshot& state, bool colours, size_t width = kWide,
                               size_t height = kHigh) {
  std::vector<std::string> lines;
  for (const WatchLine& line : watch_lines(state, width, height))
    lines.push_back(line.text(colours));
  return lines;
}

TEST(WatchTable, shows_every_node_with_its_cameras_below) {
  const auto lines = texts(studio(), false);
  ASSERT_EQ(lines.size(), 6U);
  EXPECT_EQ(lines[0], "dome   recording kendo-07   300 pulses   2/2 cameras   0 missing");
  EXPECT_THAT(lines[3], AllOf(HasSubstr("cap01"), HasSubstr("recording"), HasSubstr("25.0/s"),
                              HasSubstr("45 min"), HasSubstr("-12 us"), HasSubstr("35 %"),
                              HasSubstr("1.2 GB"), HasSubstr("51 C")));
  EXPECT_THAT(lines[5], AllOf(HasSubstr("  cam02"), HasSubstr("streaming"), HasSubstr("25.0/s")));
}

TEST(WatchTable, highlights_a_node_that_does_not_record_the_running_take) {
  StudioSnapshot state = studio();
  state.nodes.push_back("cap02");
  state.health["cap02"] = capture_health();
  EXPECT_THAT(texts(state, true)[6], Not(HasSubstr("\033")));
  state.health["cap02"].state = wire::NodeState::kIdle;
  state.health["cap02"].take = "";
  EXPECT_THAT(texts(state, true)[6], HasSubstr("\033[1;31midle"));
  EXPECT_THAT(texts(state, false)[0], HasSubstr("2/4 cameras   0 missing   cap02 does not record"));
}

TEST(WatchTable, shows_the_levels_of_the_sound_of_a_node) {
  StudioSnapshot state = studio();
  auto& values = state.health["cap01"].values;
  values["sound_open_flag"] = 1;
  values["sound_peak_1_db"] = -20.2;
  values["sound_peak_2_db"] = 0;
  values["sound_xruns"] = 3;
  EXPECT_THAT(texts(state, false), Contains(HasSubstr("sound peaks (dB)  1: -20  2: 0  xruns: 3")));
  values["sound_channels_clipping"] = 1;
  values["sound_channels_silent"] = 2;
  values["sound_timecode_jumps"] = 4;
  EXPECT_THAT(texts(state, false), Contains(HasSubstr("2: 0  clipping channels: 1  silent "
                                                      "channels: 2  xruns: 3  timecode jumps: 4")));
  values["sound_open_flag"] = 0;
  EXPECT_THAT(texts(state, false), Contains(HasSubstr("sound: the device is not open")));
}

TEST(WatchTable, shows_the_state_of_the_timecode_output) {
  StudioSnapshot state = studio();
  EXPECT_THAT(texts(state, false), Not(Contains(HasSubstr("timecode output"))));
  auto& values = state.health["cap01"].values;
  values["timecode_output_open_flag"] = 1;
  values["timecode_output_underruns"] = 0;
  EXPECT_THAT(texts(state, false), Contains("  timecode output plays"));
  values["timecode_output_underruns"] = 2;
  EXPECT_THAT(texts(state, false), Contains("  timecode output plays  underruns: 2"));
  values["timecode_output_open_flag"] = 0;
  EXPECT_THAT(texts(state, false), Contains("  timecode output: the device is not open"));
}

TEST(WatchTable, shows_the_scene_of_the_lamps) {
  StudioSnapshot state = studio();
  EXPECT_THAT(texts(state, false), Not(Contains(HasSubstr("lights"))));
  auto& values = state.health["cap01"].values;
  values["lights_connected_flag"] = 1;
  values["take_light_flag"] = 0;
  EXPECT_THAT(texts(state, false), Contains("  lights: work"));
  values["take_light_flag"] = 1;
  EXPECT_THAT(texts(state, false), Contains("  lights: take"));
  values["lights_connected_flag"] = 0;
  EXPECT_THAT(texts(state, false), Contains("  lights: not connected"));
}

TEST(WatchTable, shows_the_temperature_of_a_camera_below_that_of_its_node) {
  StudioSnapshot state = studio();
  state.health["cap01"].values["cam02.temperature_celsius"] = 62;
  const auto lines = texts(state, false);
  EXPECT_THAT(lines[4], Not(HasSubstr(" C")));
  EXPECT_EQ(lines[5].find("62 C"), lines[3].find("51 C"));
}

TEST(WatchTable, has_no_colour_without_a_fault) {
  EXPECT_THAT(texts(studio(), true), Not(Contains(HasSubstr("\033["))));
}

TEST(WatchTable, colours_faults_and_nothing_else) {
  const auto alarms = [](const std::function<void(StudioSnapshot&)>& change) {
    StudioSnapshot state = studio();
    change(state);
    size_t parts = 0;
    for (const WatchLine& line : watch_lines(state, kWide, kHigh)) {
      for (const WatchLine::Part& part : line.parts) parts += part.highlight != Highlight::kNone;
    }
    return parts;
  };
  const auto set = [](const char* name, double value) {
    return [=](StudioSnapshot& state) { state.health["cap01"].values[name] = value; };
  };
  EXPECT_EQ(alarms(set("cam02.frames_missing", 1)), 1U);
  EXPECT_EQ(alarms(set("cam02.frames_suspect", 1)), 1U);
  EXPECT_EQ(alarms(set("cam02.streaming_flag", 0)), 1U);
  EXPECT_EQ(alarms(set("disk_seconds_left", 30)), 1U);
  EXPECT_EQ(alarms(set("clock_synchronised_flag", 0)), 1U);
  EXPECT_EQ(alarms(set("clock_offset_us", -5000)), 1U);
  EXPECT_EQ(alarms(set("temperature_max_celsius", 95)), 1U);
  EXPECT_EQ(alarms(set("cam02.temperature_celsius", 74)), 0U);
  EXPECT_EQ(alarms(set("cam02.temperature_celsius", 76)), 1U);
  EXPECT_EQ(alarms([](StudioSnapshot& state) { state.health.clear(); }), 1U) << "a silent node";
  EXPECT_EQ(
      alarms([](StudioSnapshot& state) { state.health["cap01"].state = wire::NodeState::kFault; }),
      1U);
  EXPECT_EQ(alarms(set("cam02.frames_dropped", 0)), 0U);
}

TEST(WatchTable, has_the_same_text_without_colours) {
  StudioSnapshot state = studio();
  state.health.clear();
  const auto lines = texts(state, false);
  EXPECT_THAT(lines, Not(Contains(HasSubstr("\033["))));
  EXPECT_THAT(lines, Contains(AllOf(HasSubstr("silent"),
                                    HasSubstr("Try: systemctl status --all 'v3d-*' on cap01"))));
}

wire::EventMessage event(const std::string& subject, const std::string& text) {
  wire::EventMessage message;
  message.node = "cap01";
  message.severity = wire::Severity::kAlarm;
  message.subject = subject;
  message.text = text;
  return message;
}

TEST(WatchTable, shows_the_last_events_below_the_table) {
  StudioSnapshot state = studio();
  for (int i = 0; i < 20; ++i) state.events.push_back(event("cam01", "event " + std::to_string(i)));
  const auto lines = texts(state, false, kWide, 12);
  ASSERT_EQ(lines.size(), 12U);
  EXPECT_THAT(lines.back(), HasSubstr("cap01  cam01: event 19"));
  EXPECT_THAT(lines[7], HasSubstr("event 15"));
}

TEST(WatchTable, drops_cameras_without_a_fault_from_a_small_window) {
  StudioSnapshot state = studio();
  state.health["cap01"].values["cam02.streaming_flag"] = 0;
  const auto lines = texts(state, false, kWide, 5);
  EXPECT_EQ(lines.size(), 5U);
  EXPECT_THAT(lines, Contains(HasSubstr("cam02")));
  EXPECT_THAT(lines, Not(Contains(HasSubstr("cam01"))));
}

TEST(WatchTable, never_exceeds_its_window) {
  StudioSnapshot state = studio();
  state.events.push_back(event("cam01", std::string(500, 'x')));
  for (size_t height : {0, 1, 2, 3, 4, 7}) {
    const auto lines = texts(state, false, 40, height);
    EXPECT_LE(lines.size(), height);
    for (const std::string& line : lines) EXPECT_LE(line.size(), 40U);
  }
}

}  // namespace
}  // namespace v3d::ctl
