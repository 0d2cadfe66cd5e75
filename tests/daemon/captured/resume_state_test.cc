// The latency of a camera before a restart, from the logs of its take.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include "daemon/captured/take_rejoin.h"
#include "support/temporary_folder.h"

namespace v3d::captured {
namespace {

using std::chrono::milliseconds;

constexpr char kCamera[] = "cam03";
constexpr Duration kPeriod = milliseconds(40);
constexpr Duration kLatency = milliseconds(23);
constexpr Duration kPrecision = std::chrono::microseconds(1);

/// Logs of a node that receives the pulses of another one.
class RecordedLogs {
 public:
  Duration offset{};                 ///< clock of the trigger's node minus that of this node
  bool times_are_known = true;       ///< of the pulses on this node's clock
  std::vector<Duration> delays{};    ///< of frames, beyond kLatency; one for each pulse
  std::vector<Duration> lateness{};  ///< of the times of pulses; none or one for each pulse

  ResumeState read() const {
    const test::TemporaryFolder folder;
    const take::TakePaths take{folder.path()};
    write(take);
    std::vector<std::string> problems;
    const EdgeTimes edges = read_edge_times(take, problems);
    EXPECT_THAT(problems, testing::IsEmpty());
    EXPECT_EQ(edges.size(), delays.size()) << "all were sensed";
    return read_resume_state(take, kCamera, edges);
  }

 private:
  void write(const take::TakePaths& take) const {
    take::EventLogWriter pulses(take.pulses()), frames(take.frames(kCamera));
    for (size_t n = 0; n < delays.size(); ++n) {
      const RealtimeInstant at =
          RealtimeInstant(std::chrono::hours(500'000)) + static_cast<int64_t>(n) * kPeriod;
      wire::PulseMessage pulse;
      pulse.pulse = static_cast<int64_t>(n);
      pulse.edge = at + offset;
      pulse.sent = pulse.edge + milliseconds(1);
      std::optional<RealtimeInstant> edge_here;
      if (times_are_known) edge_here = at + (lateness.empty() ? Duration{} : lateness[n]);
      EXPECT_TRUE(pulses.write(pulse, edge_here));
      wire::FrameMessage message;
      message.frame.camera = kCamera;
      message.frame.label.pulse = pulse.pulse;
      message.frame.label.camera_counter = n;
      message.frame.label.received = at + kLatency + delays[n];
      message.frame.image = Image({4, 2}, PixelFormat::kMono8);
      EXPECT_TRUE(frames.write(message));
    }
  }
};

RC_GTEST_PROP(ResumeState, has_the_latency_of_the_camera_whatever_the_clock_of_the_trigger_shows,
              ()) {
  RecordedLogs logs;
  logs.offset = std::chrono::microseconds(*rc::gen::inRange(-2'000'000, 2'000'001));
  logs.delays.assign(static_cast<size_t>(*rc::gen::inRange(8, 40)), Duration{});
  const std::optional<Duration> latency = logs.read().camera.latency;
  RC_ASSERT(latency.has_value());
  RC_ASSERT(std::chrono::abs(*latency - kLatency) <= kPrecision);
}

TEST(ResumeState, has_no_latency_if_the_times_of_pulses_on_this_node_are_unknown) {
  for (const int ms : {-100, 0, 80}) {
    RecordedLogs logs;
    logs.offset = milliseconds(ms);
    logs.times_are_known = false;
    logs.delays.assign(20, Duration{});
    EXPECT_EQ(logs.read().camera.latency, std::nullopt) << ms;
  }
}

TEST(ResumeState, has_the_latency_of_early_frames_but_not_of_pulses_that_were_timed_late) {
  RecordedLogs logs;
  for (int n = 0; n < 40; ++n) {
    logs.delays.emplace_back(milliseconds(n % 2 == 0 ? 0 : 17));
    logs.lateness.emplace_back(milliseconds(n % 10 == 0 ? 9 : 0));
  }
  const std::optional<Duration> latency = logs.read().camera.latency;
  ASSERT_TRUE(latency);
  EXPECT_LE(std::chrono::abs(*latency - kLatency), kPrecision);
}

TEST(ResumeState, ignores_a_damaged_time_of_a_pulse) {
  const test::TemporaryFolder folder;
  const take::TakePaths take{folder.path()};
  {
    take::EventLogWriter pulses(take.pulses());
    EXPECT_TRUE(pulses.write(wire::PulseMessage(), from_ns<Realtime>(-5'000)));
  }
  std::vector<std::string> problems;
  const EdgeTimes edges = read_edge_times(take, problems);
  ASSERT_EQ(edges.size(), 1U);
  EXPECT_EQ(edges.at(0), std::nullopt);
}

}  // namespace
}  // namespace v3d::captured
