#include "daemon/captured/node_sound.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/prctl.h>
#include <unistd.h>

#include <cmath>
#include <csignal>
#include <cstdlib>

#include "sound/wave_file.h"
#include "support/child_process.h"
#include "support/sounding_take.h"
#include "support/temporary_folder.h"
#include "support/wait_for_child.h"
#include "take/take_sound.h"

namespace v3d::captured {
namespace {

using testing::AllOf;
using testing::DoubleNear;
using testing::ElementsAre;
using testing::Ge;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Le;
using testing::SizeIs;

constexpr int kRate = 48'000;
constexpr double kPulseRate = 25;

StudioSound simulated(const std::string& options = "") {
  return {.node = "cap01",
          .device = "simulated:" + options,
          .channels = 3,
          .pulse_channel = 0,
          .timecode_channel = 3,
          .timecode_rate = {}};
}

class NodeSoundTest : public testing::Test {
 protected:
  /// Sends the pulses from now on for a second, and waits until the device has recorded them.
  void send_pulses(NodeSound& sound) {
    ASSERT_TRUE(records(sound, kRate / 2));
    const MonotonicInstant start = Monotonic::now();
    for (int64_t n = 0; n < 25; ++n) {
      sound.pulse_at({.pulse = n, .at = start + n * period_of(kPulseRate)});
    }
    EXPECT_TRUE(
        records(sound, std::llround(kRate * (to_seconds(start - before_the_device_) + 1.5))));
  }
  /// The timecode of a pulse, by the ledger of the take.
  std::string timecode_at(int64_t pulse, const take::SoundLedger& sound) {
    test::write_sounds_of_ledger(take_, {sound});
    const auto timecode = take::TakeTimecode(take_).at(pulse);
    return timecode ? timecode->text() : "none";
  }
  bool records(NodeSound& sound, int64_t samples) {
    return test::becomes_true([&] { return sound.status().take.samples >= samples; },
                              test::within(60));
  }

  const MonotonicInstant before_the_device_ = Monotonic::now();
  const test::TemporaryFolder folder_;
  const take::TakePaths take_{folder_ / "kendo-07"};
};

TEST_F(NodeSoundTest, writes_the_file_that_the_ledger_describes) {
  NodeSound sound(simulated(), {});
  sound.begin(take_, "kendo-07", kPulseRate);
  send_pulses(sound);
  const auto ledger = sound.end();
  ASSERT_TRUE(ledger);
  EXPECT_EQ(ledger->file, "sound/cap01.wav");
  const auto wave = sound::WaveReader::open(take_.folder / ledger->file);
  ASSERT_TRUE(wave) << wave.error().message;
  EXPECT_EQ(wave->samples(), ledger->samples);
  EXPECT_EQ(wave->format(), (sound::WaveFormat{.rate_hz = kRate, .channels = 3}));
  EXPECT_EQ(wave->origin().description, "take kendo-07, node cap01");
  EXPECT_EQ(ledger->xruns, 0);
  EXPECT_EQ(ledger->map_source, "time stamps");
  // Twenty-five pulses, a period apart.
  const double apart = ledger->map.sample_of(24) - ledger->map.sample_of(0);
  EXPECT_THAT(apart, DoubleNear(24 * kRate / kPulseRate, 2));
  EXPECT_EQ(ledger->timecode_source, "ltc");
  EXPECT_EQ(ledger->timecode_rate, "25");
  EXPECT_THAT(ledger->first_timecode, HasSubstr("10:00:"));
  EXPECT_EQ(timecode_at(0, *ledger), ledger->first_timecode);
  EXPECT_EQ(timecode_at(24, *ledger), ledger->last_timecode);
  // The file begins with the device, and so with its timecode.
  EXPECT_THAT(wave->origin().timecode_rate, testing::Optional(sound::TimecodeRate::k25));
  const auto since_ten =
      static_cast<double>(wave->origin().samples_since_midnight - 36'000LL * kRate);
  const sound::TimecodeRun& run = ledger->timecode_runs.front();
  const double frames = static_cast<double>(run.first_frame) - 36'000.0 * 25;
  EXPECT_THAT(since_ten, DoubleNear(frames * kRate / 25 - run.first_sample, 1.5));
}

TEST_F(NodeSoundTest, counts_a_jump_of_the_timecode_while_it_records) {
  NodeSound sound(simulated("timecode_jump_s=1.5"), {});
  sound.begin(take_, "kendo-07", kPulseRate);
  send_pulses(sound);
  EXPECT_TRUE(
      test::becomes_true([&] { return sound.status().take.timecode_jumps > 0; }, test::within(60)));
  EXPECT_THAT(sound.status().take.first_jump,
              testing::MatchesRegex("20:00:0.:.. instead of 10:00:0.:.."));
  const auto ledger = sound.end();
  ASSERT_TRUE(ledger);
  EXPECT_EQ(ledger->timecode_jumps, 1);
  EXPECT_THAT(ledger->timecode_runs, SizeIs(2));
}

TEST_F(NodeSoundTest, has_the_time_of_day_where_no_timecode_is_recorded) {
  StudioSound silent = simulated();
  silent.timecode_channel = 0;
  NodeSound sound(silent, {});
  sound.begin(take_, "kendo-07", kPulseRate);
  send_pulses(sound);
  const auto ledger = sound.end();
  ASSERT_TRUE(ledger);
  EXPECT_EQ(ledger->timecode_source, "time of day");
  EXPECT_THAT(ledger->first_timecode, SizeIs(11));
  EXPECT_EQ(timecode_at(0, *ledger), ledger->first_timecode);
  EXPECT_EQ(timecode_at(24, *ledger), ledger->last_timecode);
}

TEST_F(NodeSoundTest, marks_xruns_at_their_sample_and_keeps_the_time) {
  NodeSound sound(simulated("xrun_s=1"), {});
  sound.begin(take_, "kendo-07", kPulseRate);
  ASSERT_TRUE(records(sound, 3 * kRate));
  const auto ledger = sound.end();
  ASSERT_TRUE(ledger);
  ASSERT_THAT(ledger->gaps.size(), Ge(2U));
  EXPECT_EQ(static_cast<int64_t>(ledger->gaps.size()), ledger->xruns);
  for (const auto& gap : ledger->gaps) EXPECT_THAT(gap[1], DoubleNear(kRate / 10.0, 5));
}

TEST_F(NodeSoundTest, records_a_second_take_in_its_own_folder) {
  NodeSound sound(simulated(), {});
  for (const std::string take : {"one", "two"}) {
    sound.begin({folder_ / take}, take, kPulseRate);
    ASSERT_TRUE(records(sound, kRate / 4));
    const auto ledger = sound.end();
    ASSERT_TRUE(ledger);
    EXPECT_EQ(ledger->xruns, 0) << "what was between the takes is no xrun";
    EXPECT_TRUE(sound::WaveReader::open(folder_ / take / "sound" / "cap01.wav"));
  }
}

TEST_F(NodeSoundTest, continues_a_take_in_a_second_file) {
  for (const std::string file : {"sound/cap01.wav", "sound/cap01.0001.wav"}) {
    NodeSound sound(simulated(), {});
    sound.begin(take_, "kendo-07", kPulseRate);
    ASSERT_TRUE(records(sound, 1));
    EXPECT_EQ(sound.end()->file, file);
  }
}

TEST_F(NodeSoundTest, reports_a_silent_channel_beside_sound_and_timecode) {
  NodeSound sound(simulated(), {});
  EXPECT_TRUE(
      test::becomes_true([&] { return !sound.status().level_faults.empty(); }, test::within(60)));
  EXPECT_THAT(sound.status().level_faults,
              ElementsAre(sound::ChannelFault{2, sound::LevelFault::kSilent}));
}

TEST_F(NodeSoundTest, reports_a_device_that_cannot_be_opened_and_records_nothing) {
  StudioSound absent = simulated();
  absent.device = "hw:CARD=NoSuchCard";
  NodeSound sound(absent, {});
  EXPECT_TRUE(test::becomes_true([&] { return !sound.status().fault.empty(); }, test::within(60)));
  EXPECT_THAT(sound.status().fault, HasSubstr("cannot open hw:CARD=NoSuchCard"));
  sound.begin(take_, "kendo-07", kPulseRate);
  EXPECT_FALSE(sound.end());
}

TEST_F(NodeSoundTest, opens_a_device_again_that_delivers_nothing_and_no_error) {
  NodeSound sound(simulated("stall_s=0.5"), {});
  sound.begin(take_, "kendo-07", kPulseRate);
  ASSERT_TRUE(records(sound, 1));
  const auto has_fault = [&] { return !sound.status().fault.empty(); };
  EXPECT_TRUE(test::becomes_true(has_fault, test::within(60)));
  EXPECT_THAT(sound.status().fault, HasSubstr("simulated:stall_s=0.5 delivers no samples"));
  // The silence of the stall, and samples of the device that was opened again.
  ASSERT_TRUE(records(sound, 3 * kRate));
  EXPECT_EQ(sound.status().fault, "");
  const auto ledger = sound.end();
  ASSERT_TRUE(ledger);
  EXPECT_THAT(ledger->xruns, Ge(1));
  ASSERT_FALSE(ledger->gaps.empty());
  EXPECT_THAT(ledger->gaps.front()[1], Ge(2.0 * kRate));
}

TEST_F(NodeSoundTest, has_a_problem_in_the_ledger_when_the_device_fails_until_the_end) {
  NodeSound sound(simulated("stall_s=1"), {});
  sound.begin(take_, "kendo-07", kPulseRate);
  const MonotonicInstant start = Monotonic::now();
  for (int64_t n = 0; n < 100; ++n) {
    sound.pulse_at({.pulse = n, .at = start + n * period_of(kPulseRate)});
  }
  ASSERT_TRUE(records(sound, 1));
  const auto has_fault = [&] { return !sound.status().fault.empty(); };
  ASSERT_TRUE(test::becomes_true(has_fault, test::within(60)));
  const auto ledger = sound.end();  // before the device is opened again, or else there is an xrun
  ASSERT_TRUE(ledger);
  EXPECT_NE(problem_line(*ledger), "");
}

TEST_F(NodeSoundTest, reports_a_device_that_never_delivers_and_not_that_it_is_open) {
  NodeSound sound(simulated("stall_s=0.001"), {});
  bool was_open = false;
  EXPECT_TRUE(test::becomes_true(
      [&] {
        const NodeSound::Status status = sound.status();
        was_open = was_open || status.is_open;
        return !status.fault.empty();
      },
      test::within(60)));
  EXPECT_FALSE(was_open);
  sound.begin(take_, "kendo-07", kPulseRate);
  EXPECT_FALSE(sound.end());
}

TEST_F(NodeSoundTest, reports_a_folder_that_cannot_be_written) {
  test::write_text(folder_ / "kendo-07", "a file where the take's folder would be");
  NodeSound sound(simulated(), {});
  sound.begin(take_, "kendo-07", kPulseRate);
  EXPECT_TRUE(
      test::becomes_true([&] { return !sound.status().take.error.empty(); }, test::within(60)));
  EXPECT_THAT(sound.status().take.error, HasSubstr("kendo-07"));
  EXPECT_FALSE(sound.end());
}

/// Kills of the recorder: V3D_SOUND_KILLS=1000 for more; each needs two seconds at most.
int kills() {
  const char* const text = std::getenv("V3D_SOUND_KILLS");
  return text == nullptr ? 5 : std::atoi(text);
}

/// Samples that a recorder has written, and those that its device has delivered since then.
struct Report {
  int64_t written = 0, waiting = 0;
};
Report report_of(NodeSound& sound) {
  const NodeSound::Status status = sound.status();
  return {.written = status.take.samples, .waiting = std::llround(kRate * status.waiting_s)};
}

TEST_F(NodeSoundTest, loses_less_than_the_last_second_when_its_process_is_killed) {
  for (int i = 0; i < kills() && !HasFailure(); ++i) {
    const take::TakePaths take{folder_ / ("take" + std::to_string(i))};
    int channel[2];
    ASSERT_EQ(pipe(channel), 0);
    const pid_t child = fork();
    if (child == 0) {
      prctl(PR_SET_PDEATHSIG, SIGKILL);
      NodeSound sound(simulated(), {});
      sound.begin(take, "kendo-07", kPulseRate);
      for (Report report;;) {
        const int64_t before = report.written;
        test::becomes_true([&] { return (report = report_of(sound)).written > before; },
                           test::within(60));
        if (write(channel[1], &report, sizeof report) != sizeof report) _exit(1);
      }
    }
    close(channel[1]);
    Report report;
    const int64_t until = kRate / 2 + i * 777 % (2 * kRate);
    while (report.written < until && read(channel[0], &report, sizeof report) == sizeof report) {
    }
    kill(child, SIGKILL);
    const int status = test::wait_for_child(child);
    close(channel[0]);
    ASSERT_EQ(status, test::kKilled) << "the recorder ended by itself";
    ASSERT_GE(report.written, until);
    const auto wave = sound::WaveReader::open(take.sound() / "cap01.wav");
    ASSERT_TRUE(wave) << wave.error().message;
    EXPECT_THAT(wave->samples(), Ge(report.written + report.waiting - kRate))
        << "of what the device had delivered, the last second at most is lost";
    EXPECT_THAT(wave->samples(), Ge(report.written)) << "all that was reported is there";
  }
}

}  // namespace
}  // namespace v3d::captured
