// Timecode that is played on ALSA's device `file`, in the time of this host.
#include "daemon/captured/timecode_output.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <cstring>
#include <memory>
#include <span>

#include "base/io/file.h"
#include "daemon/captured/node_sound.h"
#include "sound/sound_device.h"
#include "sound/timecode.h"
#include "support/child_process.h"
#include "support/temporary_folder.h"

namespace v3d::captured {
namespace {

using testing::Ge;
using testing::HasSubstr;

constexpr int kRate = 48'000;

/// A device that stops after 480 samples without an error, as after a loss of its word clock.
class StoppedOutput : public sound::SoundOutput {
 public:
  io::Result<sound::PlayedSamples> wait(Duration) override {
    return sound::PlayedSamples{.played = 480, .at = Monotonic::now()};
  }
  io::Status write(std::span<const float>) override { return {}; }
};

class TimecodeOutputTest : public testing::Test {
 protected:
  StudioTimecodeOutput output(const std::string& start = "10:00:00:00") const {
    return {.device = "file:" + (folder_ / "played.raw").string() + ",raw", .start = start};
  }
  /// The first channel of what was played.
  std::vector<float> played() const {
    const auto text = io::read_file(folder_ / "played.raw", 1 << 30);
    if (!text) return {};
    std::vector<float> samples;
    for (size_t at = 0; at + 8 <= text->size(); at += 8) {
      int32_t value = 0;
      std::memcpy(&value, text->data() + at, sizeof value);
      samples.push_back(static_cast<float>(value / 2147483648.0));
    }
    return samples;
  }
  bool has_played(double seconds) const {
    return test::becomes_true(
        [&] {
          const auto size = std::filesystem::exists(folder_ / "played.raw")
                                ? std::filesystem::file_size(folder_ / "played.raw")
                                : 0;
          return static_cast<double>(size) > seconds * kRate * 8;
        },
        test::within(60));
  }

  const test::TemporaryFolder folder_;
};

TEST_F(TimecodeOutputTest, plays_successive_frames_from_the_start) {
  const auto plays_without_underrun = [&] {  // a busy host may let the device run empty
    std::filesystem::remove(folder_ / "played.raw");
    TimecodeOutput timecode(output());
    EXPECT_TRUE(has_played(2));
    EXPECT_TRUE(timecode.status().is_open);
    return timecode.status().underruns == 0;
  };
  ASSERT_TRUE(test::becomes_true(plays_without_underrun, test::within(120)));
  sound::LtcReader reader(kRate);
  sound::TimecodeTrack track(kRate, sound::TimecodeRate::k25);
  std::vector<sound::LtcFrame> frames = reader.push(played());
  ASSERT_THAT(frames.size(), Ge(40U));
  for (const sound::LtcFrame& frame : frames) track.add(frame);
  EXPECT_EQ(track.jumps(), 0);
  EXPECT_EQ(frames.front().timecode.hours, 10);
  EXPECT_EQ(frames.front().timecode.minutes, 0);
}

TEST_F(TimecodeOutputTest, counts_an_underrun_when_a_device_that_takes_samples_at_once_has_none) {
  const auto device = sound::open_sound_output(output());
  ASSERT_TRUE(device) << device.error().message;
  const std::vector<float> silence(kRate / 100);
  for (int64_t count = 1; count <= 2; ++count) {
    ASSERT_TRUE((*device)->wait(Duration(0)));
    ASSERT_TRUE((*device)->write(silence));
    sound::PlayedSamples played;
    const auto runs_empty = [&] {
      played = (*device)->wait(Duration(0)).value();
      return played.underruns == count;
    };
    EXPECT_TRUE(test::becomes_true(runs_empty, test::within(60)));
    EXPECT_EQ(played.played, count * std::ssize(silence)) << "it has played what it had";
  }
}

TEST_F(TimecodeOutputTest, is_the_timecode_of_the_pulses_of_a_take_without_ltc) {
  TimecodeOutput timecode(output("20:15:00:00"));
  NodeSound sound({.node = "cap01", .device = "simulated:", .timecode_rate = {}}, {},
                  [&] { return timecode.clock(); });
  sound.begin({folder_ / "kendo-07"}, "kendo-07", 25);
  timecode.begin_train(25);
  const auto recorded = [&](int64_t samples) {
    return test::becomes_true([&] { return sound.status().take.samples >= samples; },
                              test::within(60));
  };
  ASSERT_TRUE(recorded(kRate / 2));
  const MonotonicInstant start = Monotonic::now();
  for (int64_t n = 0; n < 25; ++n) {
    const capture::PulseEdge edge{.pulse = n, .at = start + n * period_of(25)};
    timecode.pulse_at(edge);
    sound.pulse_at(edge);
  }
  ASSERT_TRUE(recorded(5 * kRate / 2));
  const auto ledger = sound.end();
  ASSERT_TRUE(ledger);
  EXPECT_EQ(ledger->timecode_source, "output");
  EXPECT_THAT(ledger->first_timecode, HasSubstr("20:15:"));
  const auto frame = [](const std::string& text) {
    return frame_number(sound::parse_timecode(text, sound::TimecodeRate::k25).value(),
                        sound::TimecodeRate::k25);
  };
  EXPECT_EQ(frame(ledger->last_timecode) - frame(ledger->first_timecode), 24);
}

TEST_F(TimecodeOutputTest, reports_a_device_that_cannot_be_opened) {
  StudioTimecodeOutput absent = output();
  absent.device = "hw:CARD=NoSuchCard";
  TimecodeOutput timecode(absent);
  EXPECT_TRUE(
      test::becomes_true([&] { return !timecode.status().fault.empty(); }, test::within(60)));
  EXPECT_THAT(timecode.status().fault, HasSubstr("cannot open hw:CARD=NoSuchCard"));
  EXPECT_FALSE(timecode.status().is_open);
}

TEST_F(TimecodeOutputTest, opens_a_device_again_that_plays_nothing_and_reports_no_error) {
  std::atomic<int> opened = 0;
  TimecodeOutput timecode(output(), [&](const StudioTimecodeOutput&) {
    ++opened;
    return io::Result<std::unique_ptr<sound::SoundOutput>>(std::make_unique<StoppedOutput>());
  });
  TimecodeOutput::Status status;
  EXPECT_TRUE(test::becomes_true(
      [&] {
        status = timecode.status();
        return !status.fault.empty();
      },
      test::within(60)));
  EXPECT_THAT(status.fault, HasSubstr("plays no samples, and reports no error"));
  EXPECT_FALSE(status.is_open);
  EXPECT_TRUE(test::becomes_true([&] { return opened > 1; }, test::within(60)));
}

}  // namespace
}  // namespace v3d::captured
