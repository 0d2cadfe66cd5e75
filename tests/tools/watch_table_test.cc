#include "v3dctl/operate/watch_table.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "v3dctl/operate/health_text.h"

namespace v3d::ctl {
namespace {

using testing::AllOf;
using testing::Contains;
using testing::HasSubstr;
using testing::Not;

constexpr size_t kWide = 200;
constexpr size_t kHigh = 100;

TEST(HealthText, gives_every_value_its_unit) {
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

TEST(HealthText, tells_times_as_people_do) {
  EXPECT_EQ(duration_text(45), "45 s");
  EXPECT_EQ(duration_text(1200), "20 min");
  EXPECT_EQ(duration_text(9000), "2.5 h");
  EXPECT_EQ(duration_text(5e5), "6 d");
}

HealthMessage capture_health() {
  HealthMessage health;
  health.node = "cap01";
  health.program = "v3d-captured";
  health.version = "0.1.0";
  health.state = NodeState::kRecording;
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

/// Everything is well.
StudioView studio() {
  StudioView view;
  view.studio = "dome";
  view.nodes = {"cap01"};
  view.cameras = {{"cap01", {"cam01", "cam02"}}};
  view.health["cap01"] = capture_health();
  return view;
}

std::vector<std::string> texts(const StudioView& view, bool colours, size_t width = kWide,
                               size_t height = kHigh) {
  std::vector<std::string> lines;
  for (const WatchLine& line : watch_lines(view, width, height))
    lines.push_back(line.text(colours));
  return lines;
}

TEST(Watch, shows_every_node_with_its_cameras_below) {
  const auto lines = texts(studio(), false);
  ASSERT_EQ(lines.size(), 6U);
  EXPECT_EQ(lines[0], "dome   recording kendo-07   300 pulses   2/2 cameras   0 missing");
  EXPECT_THAT(lines[3], AllOf(HasSubstr("cap01"), HasSubstr("recording"), HasSubstr("25.0/s"),
                              HasSubstr("45 min"), HasSubstr("-12 us"), HasSubstr("35 %"),
                              HasSubstr("1.2 GB"), HasSubstr("51 C")));
  EXPECT_THAT(lines[5], AllOf(HasSubstr("  cam02"), HasSubstr("streaming"), HasSubstr("25.0/s")));
}

TEST(Watch, has_no_colour_where_nobody_must_look) {
  EXPECT_THAT(texts(studio(), true), Not(Contains(HasSubstr("\033["))));
}

TEST(Watch, colours_what_a_person_must_look_at_and_only_that) {
  const auto alarms = [](const std::function<void(StudioView&)>& spoil) {
    StudioView view = studio();
    spoil(view);
    size_t parts = 0;
    for (const WatchLine& line : watch_lines(view, kWide, kHigh)) {
      for (const WatchLine::Part& part : line.parts) parts += part.look != Look::kNone;
    }
    return parts;
  };
  const auto set = [](const char* name, double value) {
    return [=](StudioView& view) { view.health["cap01"].values[name] = value; };
  };
  EXPECT_EQ(alarms(set("cam02.frames_missing", 1)), 1U);
  EXPECT_EQ(alarms(set("cam02.frames_suspect", 1)), 1U);
  EXPECT_EQ(alarms(set("cam02.streaming_flag", 0)), 1U);
  EXPECT_EQ(alarms(set("disk_seconds_left", 30)), 1U);
  EXPECT_EQ(alarms(set("clock_synchronised_flag", 0)), 1U);
  EXPECT_EQ(alarms(set("clock_offset_us", -5000)), 1U);
  EXPECT_EQ(alarms(set("temperature_max_celsius", 95)), 1U);
  EXPECT_EQ(alarms([](StudioView& view) { view.health.clear(); }), 1U) << "a silent node";
  EXPECT_EQ(alarms([](StudioView& view) { view.health["cap01"].state = NodeState::kFault; }), 1U);
  EXPECT_EQ(alarms(set("cam02.frames_dropped", 0)), 0U);
}

TEST(Watch, is_the_same_text_without_colours) {
  StudioView view = studio();
  view.health.clear();
  const auto lines = texts(view, false);
  EXPECT_THAT(lines, Not(Contains(HasSubstr("\033["))));
  EXPECT_THAT(lines, Contains(AllOf(HasSubstr("silent"), HasSubstr("on cap01"))));
}

EventMessage event(const std::string& subject, const std::string& text) {
  EventMessage message;
  message.node = "cap01";
  message.severity = Severity::kAlarm;
  message.subject = subject;
  message.text = text;
  return message;
}

TEST(Watch, tells_the_last_events_below_the_table) {
  StudioView view = studio();
  for (int i = 0; i < 20; ++i) view.events.push_back(event("cam01", "event " + std::to_string(i)));
  const auto lines = texts(view, false, kWide, 12);
  ASSERT_EQ(lines.size(), 12U);
  EXPECT_THAT(lines.back(), HasSubstr("cap01  cam01: event 19"));
  EXPECT_THAT(lines[7], HasSubstr("event 15"));
}

TEST(Watch, leaves_out_cameras_that_are_well_before_those_that_are_not) {
  StudioView view = studio();
  view.health["cap01"].values["cam02.streaming_flag"] = 0;
  const auto lines = texts(view, false, kWide, 5);
  EXPECT_EQ(lines.size(), 5U);
  EXPECT_THAT(lines, Contains(HasSubstr("cam02")));
  EXPECT_THAT(lines, Not(Contains(HasSubstr("cam01"))));
}

TEST(Watch, never_leaves_its_window) {
  StudioView view = studio();
  view.events.push_back(event("cam01", std::string(500, 'x')));
  for (size_t height : {0, 1, 2, 3, 4, 7}) {
    const auto lines = texts(view, false, 40, height);
    EXPECT_LE(lines.size(), height);
    for (const std::string& line : lines) EXPECT_LE(line.size(), 40U);
  }
}

TEST(Health, is_a_table_of_cameras_below_the_values_of_the_node) {
  const auto lines = health_lines({"cap01", "cap02"}, studio().health);
  EXPECT_THAT(lines, Contains(AllOf(HasSubstr("disk_free_bytes"), HasSubstr("812 GB"))));
  EXPECT_THAT(lines, Contains(AllOf(HasSubstr("version"), HasSubstr("0.1.0"))));
  EXPECT_THAT(lines, Contains(HasSubstr("   cam01   cam02")));
  EXPECT_THAT(lines, Contains(AllOf(HasSubstr("frames_per_second"), HasSubstr("25.0/s  25.0/s"))));
  EXPECT_THAT(lines.back(), AllOf(HasSubstr("cap02"), HasSubstr("silent")));
}

}  // namespace
}  // namespace v3d::ctl
