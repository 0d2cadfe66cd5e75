#include "sound/sound_track.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <fstream>

#include "pulse_signal.h"
#include "sound/level_monitor.h"
#include "sound/sound_device.h"

namespace v3d::sound {
namespace {

using testing::DoubleNear;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::Optional;

constexpr int kRate = 48'000;
constexpr int64_t kBlock = 480;

StudioSound three_channels(int rate_hz = kRate) {
  return {.node = "cap01",
          .device = "simulated:",
          .channels = 3,
          .rate_hz = rate_hz,
          .pulse_channel = 2,
          .timecode_channel = 3,
          .timecode_rate = {}};
}

MonotonicInstant at_sample(double sample, int rate_hz = kRate) {
  return from_ns<Monotonic>(std::llround(1e9 * (5 + sample / rate_hz)));
}

StudioSound one_channel(int rate_hz = kRate) {
  StudioSound sound;
  sound.channels = 1;
  sound.rate_hz = rate_hz;
  return sound;
}

/// Ten seconds of a device: silence, pulses at 25 Hz from second 1 on, and LTC from 10:00:00:00.
class Recording {
 public:
  explicit Recording(int rate_hz = kRate)
      : rate_hz_(rate_hz), pulses_(static_cast<size_t>(10 * rate_hz)) {
    for (int n = 0; n < 220; ++n) {
      edges_.push_back(rate_hz + rate_hz / 25.0 * n + 0.25);
      test::add_pulse(pulses_, edges_.back(), 1e-3 * rate_hz, 0.5);
    }
    LtcWriter ltc(rate_hz, TimecodeRate::k25, {10, 0, 0, 0});
    while (ltc_.size() < pulses_.size()) {
      const auto frame = ltc.next();
      ltc_.insert(ltc_.end(), frame.begin(), frame.end());
    }
  }

  SoundBlock block(int64_t first, int64_t position, int64_t xruns) const {
    SoundBlock block{.position = position,
                     .xruns = xruns,
                     .at = at_sample(static_cast<double>(first + kBlock), rate_hz_)};
    for (int64_t s = first; s < first + kBlock; ++s) {
      block.values.push_back(0);
      block.values.push_back(value(pulses_[static_cast<size_t>(s)]));
      block.values.push_back(value(ltc_[static_cast<size_t>(s)]));
    }
    return block;
  }
  /// From the first sample to the end, exclusive.
  struct Range {
    int64_t from = 0, until = 0;
  };
  /// Adds all blocks but the lost ones.
  void play(SoundTrack& track, const std::vector<Range>& lost, bool as_xrun) const {
    int64_t delivered = 0, xruns = 0;
    size_t pulse = 0;
    for (int64_t first = 0; first + kBlock <= std::ssize(pulses_); first += kBlock) {
      if (as_xrun) xruns += std::ranges::count(lost, first, &Range::until);
      const bool is_lost = std::ranges::any_of(
          lost, [&](const Range& range) { return first >= range.from && first < range.until; });
      for (; pulse < edges_.size() && edges_[pulse] < static_cast<double>(first); ++pulse) {
        track.add_pulse(static_cast<int64_t>(pulse), at_sample(edges_[pulse], rate_hz_));
      }
      if (!is_lost) track.add(block(first, delivered, xruns));
      if (!is_lost || !as_xrun) delivered += kBlock;
    }
    track.finish();
  }
  double edge(size_t pulse) const { return edges_[pulse]; }

 private:
  static int32_t value(float v) { return static_cast<int32_t>(std::lround(v * 8e6)) * 256; }

  const int rate_hz_;
  std::vector<float> pulses_, ltc_;
  std::vector<double> edges_;
};

TEST(SoundTrack, maps_every_pulse_to_its_sample_and_timecode_at_48_and_96_khz) {
  for (const int rate_hz : {48'000, 96'000}) {
    SCOPED_TRACE(rate_hz);
    const Recording recording(rate_hz);
    SoundTrack track({.sound = three_channels(rate_hz)});
    recording.play(track, {}, false);
    EXPECT_EQ(track.samples(), 10 * rate_hz);
    EXPECT_EQ(track.xruns(), 0);
    const MappedPulses mapped = track.pulses();
    ASSERT_EQ(mapped.source, MapSource::kPulseChannel);
    EXPECT_EQ(mapped.edges, 220);
    EXPECT_THAT(mapped.map.sample_of(100), DoubleNear(recording.edge(100), 0.1));
    ASSERT_THAT(track.timecode()->rate(), Optional(TimecodeRate::k25));
    EXPECT_THAT(track.timecode()->at(mapped.map.sample_of(100)), Optional(Timecode{10, 0, 5, 0}));
  }
}

TEST(SoundTrack, fills_blocks_that_were_dropped_with_as_many_samples_of_silence) {
  const Recording recording;
  SoundTrack track({.sound = three_channels()});
  recording.play(track, {{5 * kRate, 6 * kRate}}, false);
  EXPECT_EQ(track.samples(), 10 * kRate);
  EXPECT_THAT(track.gaps(), ElementsAre(SoundGap{5 * kRate, kRate}));
  EXPECT_THAT(track.pulses().map.sample_of(200), DoubleNear(recording.edge(200), 0.1));
}

TEST(SoundTrack, estimates_the_length_of_an_xrun_from_time_stamps) {
  const Recording recording;
  SoundTrack track({.sound = three_channels()});
  recording.play(track, {{5 * kRate, 6 * kRate}}, true);
  ASSERT_EQ(track.xruns(), 1);
  EXPECT_EQ(track.gaps()[0].sample, 5 * kRate);
  EXPECT_THAT(static_cast<double>(track.gaps()[0].samples), DoubleNear(kRate, 5));
  EXPECT_THAT(track.pulses().map.sample_of(200), DoubleNear(recording.edge(200), 5));
}

TEST(SoundTrack, estimates_the_length_of_an_xrun_that_follows_another_one_within_50_ms) {
  const Recording recording;
  SoundTrack track({.sound = three_channels()});
  constexpr int64_t kBegin = 6 * kRate + 5 * kBlock;
  recording.play(track, {{5 * kRate, 6 * kRate}, {kBegin, kBegin + kRate}}, true);
  ASSERT_EQ(track.xruns(), 2);
  EXPECT_THAT(static_cast<double>(track.gaps()[1].samples), DoubleNear(kRate, 5));
  EXPECT_THAT(static_cast<double>(track.samples()), DoubleNear(10 * kRate, 10));
  EXPECT_THAT(track.pulses().map.sample_of(200), DoubleNear(recording.edge(200), 10));
}

/// Limits the memory of this process to 256 MiB more than it has.
void limit_memory() {
  std::ifstream statm("/proc/self/statm");
  rlim_t pages = 0;
  statm >> pages;
  const rlim_t bytes = pages * static_cast<rlim_t>(sysconf(_SC_PAGESIZE)) + (256U << 20);
  const rlimit limit{bytes, bytes};
  if (setrlimit(RLIMIT_AS, &limit) != 0) _exit(2);
}

TEST(SoundTrackDeathTest, needs_little_memory_for_ten_minutes_of_silence_in_64_channels) {
  const auto fill = [] {
    limit_memory();
    StudioSound sound = three_channels();
    sound.channels = 64;
    SoundTrack track({.sound = sound});
    SoundBlock block{.at = at_sample(kBlock), .values = std::vector<int32_t>(64 * kBlock)};
    track.add(block);
    block.position = 600 * kRate;
    const bool is_filled = track.add(block) == 600 * kRate - kBlock;
    _exit(is_filled ? 0 : 1);
  };
  EXPECT_EXIT(fill(), testing::ExitedWithCode(0), "");
}

TEST(SoundTrack, has_the_peak_of_every_channel_since_the_last_call) {
  SoundTrack track({.sound = {.node = "", .device = "", .timecode_rate = {}}});
  track.add({.at = at_sample(2), .values = {1 << 30, 0, -(1 << 29), 256}});
  EXPECT_THAT(track.pop_peaks(), ElementsAre(0.5, DoubleNear(0, 1e-6)));
  EXPECT_THAT(track.pop_peaks(), ElementsAre(0, 0));
}

TEST(SoundInput, rejects_an_unknown_device_with_its_name) {
  StudioSound sound = three_channels();
  sound.device = "hw:CARD=NoSuchCard";
  const auto input = open_sound_input(sound, {});
  ASSERT_FALSE(input);
  EXPECT_THAT(input.error().message, HasSubstr("cannot open hw:CARD=NoSuchCard: "));
}

TEST(SoundInput, records_from_an_alsa_device) {
  StudioSound sound = three_channels();
  sound.device = "null";
  auto input = open_sound_input(sound, {});
  ASSERT_TRUE(input) << input.error().message;
  const auto block = (*input)->read(std::chrono::seconds(1));
  ASSERT_TRUE(block) << block.error().message;
  ASSERT_TRUE(*block);
  EXPECT_EQ((*block)->values.size() % 3, 0U);
}

TEST(SimulatedSound, reads_its_options) {
  EXPECT_EQ(parse_simulated_sound("hw:0"), std::nullopt);
  ASSERT_TRUE(parse_simulated_sound("simulated:"));
  const auto options = parse_simulated_sound("simulated:ppm=-80.5,xrun_s=3");
  ASSERT_TRUE(options);
  EXPECT_EQ(options->ppm, -80.5);
  EXPECT_EQ(options->xrun_s, 3);
  for (const char* bad : {"simulated:ppm", "simulated:ppm=", "simulated:ppm=1;", "simulated:gain=1",
                          "simulated:ppm=5000", "simulated:xrun_s=-1", "simulated:clap_ms=-1",
                          "simulated:timecode_jump_s=-1"}) {
    EXPECT_FALSE(parse_simulated_sound(bad)) << bad;
  }
}

TEST(SimulatedSound, claps_at_its_time_after_a_pulse) {
  const auto options = parse_simulated_sound("simulated:clap_edge=2,clap_ms=50");
  ASSERT_TRUE(options);
  const MonotonicInstant begin = Monotonic::now();
  bool has_come = false;
  auto input = make_simulated_input(three_channels(), *options, [&] {
    std::vector<MonotonicInstant> pulses;
    if (!std::exchange(has_come, true)) {
      pulses = {begin + std::chrono::milliseconds(100), begin + std::chrono::milliseconds(140)};
    }
    return pulses;
  });
  ClapFinder finder(three_channels().rate_hz);
  MonotonicInstant end;
  for (int i = 0; i < 40; ++i) {
    const auto block = input->read(std::chrono::seconds(10));
    ASSERT_TRUE(block && *block);
    finder.push(channel_of((*block)->values, 3, 1));
    end = (*block)->at;
  }
  ASSERT_TRUE(finder.clap());
  const double before_end_s = (40 * kBlock - finder.clap()->sample) / three_channels().rate_hz;
  EXPECT_THAT(to_seconds(end - begin) - before_end_s, DoubleNear(0.190, 0.002));
}

TEST(SimulatedSound, delivers_consecutive_blocks_with_the_pulses_that_came) {
  StudioSound sound = three_channels();
  std::vector<MonotonicInstant> coming;
  auto input = make_simulated_input(sound, {}, [&] { return std::exchange(coming, {}); });
  SoundTrack track({.sound = sound});
  for (int i = 0; i < 40; ++i) {
    const auto block = input->read(std::chrono::seconds(10));
    ASSERT_TRUE(block && *block);
    EXPECT_EQ((*block)->position, i * kBlock);
    EXPECT_EQ(track.add(**block), 0);
    if (i == 0) coming = {(*block)->at + std::chrono::milliseconds(100)};  // ten blocks later
  }
  const auto peaks = track.pop_peaks();
  EXPECT_THAT(peaks[0], DoubleNear(0.1, 0.01));
  EXPECT_THAT(peaks[1], DoubleNear(0.5, 0.01));
}

TEST(SoundTrack, maps_pulses_after_a_gap_that_is_longer_than_the_longest_silence) {
  constexpr int kLowRate = 8000;
  constexpr double kPeriod = 0.04, kAwayFrom = 60, kAwayUntil = 960, kEnd = 1080;
  SoundTrack track({.sound = one_channel(kLowRate)});
  int64_t pulse = 0, position = 0, xruns = 0;
  const auto add_pulses_until = [&](double end) {
    for (; static_cast<double>(pulse) * kPeriod <= end; ++pulse) {
      track.add_pulse(pulse, at_sample(static_cast<double>(pulse) * kPeriod * kLowRate, kLowRate));
    }
  };
  const auto record = [&](double begin, double end) {
    for (int64_t n = 0; n < std::llround((end - begin) * 100); ++n, position += 80) {
      const double now = begin + static_cast<double>(n + 1) / 100;
      add_pulses_until(now);
      track.add({.position = position,
                 .xruns = xruns,
                 .at = at_sample(now * kLowRate, kLowRate),
                 .values = std::vector<int32_t>(80)});
    }
  };
  record(0, kAwayFrom);
  add_pulses_until(kAwayUntil);
  ++xruns;
  record(kAwayUntil, kEnd);
  track.finish();
  for (const double at : {970.0, 1020.0}) {
    const double in_file = static_cast<double>(track.samples()) / kLowRate - (kEnd - at);
    EXPECT_NEAR(track.pulses().map.sample_of(at / kPeriod) / kLowRate, in_file, 0.02) << at;
  }
}

TEST(SoundTrack, counts_the_lost_samples_of_more_gaps_than_it_lists) {
  SoundTrack track({.sound = one_channel()});
  int64_t silence = 0;
  for (int64_t n = 0; n < 1500; ++n) {
    silence += track.add({.position = 2 * kBlock * n,
                          .at = at_sample(static_cast<double>(2 * kBlock * n)),
                          .values = std::vector<int32_t>(kBlock)});
  }
  EXPECT_EQ(track.gaps().size(), SoundTrack::kMaxGaps);
  EXPECT_EQ(silence, 1499 * kBlock);
  EXPECT_EQ(track.lost_samples(), silence);
}

}  // namespace
}  // namespace v3d::sound
