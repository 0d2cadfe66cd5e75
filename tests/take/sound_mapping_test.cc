// Sound files of a take that was not closed: the positions of pulses after the recovery.
#include "take/ledger/sound_mapping.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "sound/ltc.h"
#include "support/begun_take.h"
#include "support/studio_text.h"
#include "support/temporary_folder.h"
#include "take/ledger/verify.h"
#include "take/logs/frame_log.h"

namespace v3d::take {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Lt;

constexpr int kRate = 48'000;
constexpr int kChannels = 3;
constexpr double kPulseRate = 25;
constexpr int kPulses = 500;
constexpr double kFirstPulse = 1.5;         ///< s after the first sample
constexpr double kClockError = 3e-3;        ///< the clock of the sound's PC is ahead, s
constexpr double kSampleClock = 1 + 80e-6;  ///< the sample clock is fast
constexpr double kMaxValue = 2147483647;
const RealtimeInstant kBegin = from_ns<Realtime>(1'795'864'000'250'000'000);

/// The sample at which a pulse begins.
double truth(int64_t pulse, int rate_hz = kRate) {
  return (kFirstPulse + static_cast<double>(pulse) / kPulseRate) * rate_hz * kSampleClock;
}

/// Adds pulses of 5 ms to channel 2.
void add_pulses(std::vector<int32_t>& values, int64_t count, int rate_hz) {
  for (int64_t pulse = 0; pulse < count; ++pulse) {
    const auto first = static_cast<int64_t>(std::ceil(truth(pulse, rate_hz)));
    for (int64_t s = first; s < first + rate_hz / 200; ++s) {
      values[static_cast<size_t>(s * kChannels + 1)] = 1 << 30;
    }
  }
}

wire::PulseMessage message_of(int64_t pulse) {
  wire::PulseMessage message;
  message.pulse = pulse;
  message.edge = kBegin + from_seconds(kFirstPulse + static_cast<double>(pulse) / kPulseRate);
  return message;
}

/// Channel 1 is silent, channel 2 has the pulses, channel 3 timecode: 10:00:00:00 is at a sample.
std::vector<int32_t> recorded_sound(int64_t timecode_begin = 0) {
  const auto samples = static_cast<int64_t>(truth(kPulses) + kRate);
  std::vector<int32_t> values(static_cast<size_t>(samples * kChannels));
  add_pulses(values, kPulses, kRate);
  sound::LtcWriter timecode(kRate, sound::TimecodeRate::k25, {.hours = 10});
  for (int64_t s = timecode_begin; s < samples;) {
    for (const float value : timecode.next()) {
      if (s == samples) break;
      values[static_cast<size_t>(s++ * kChannels + 2)] = static_cast<int32_t>(value * kMaxValue);
    }
  }
  return values;
}

/// A take whose recording process was killed.
class RecordedSounds : public testing::Test {
 protected:
  RecordedSounds() {
    std::filesystem::create_directories(paths_.sound());
    TakeInfo info = test::begun_take({});
    info.rate_hz = kPulseRate;
    EXPECT_TRUE(save_take_info(paths_, info));
    write_pulses(0, kPulses);
  }

  void write_pulses(int64_t first, int64_t end) {
    EventLogWriter pulses(paths_.pulses(), LogOpening::kContinue);
    for (int64_t pulse = first; pulse < end; ++pulse) {
      ASSERT_TRUE(pulses.write(message_of(pulse)));
    }
  }
  /// The sound file in the ledger, which has no other.
  SoundLedger only_sound() const {
    const std::vector<SoundLedger> sounds = load_ledger(paths_.ledger()).sounds;
    EXPECT_EQ(sounds.size(), 1U);
    return sounds.empty() ? SoundLedger{} : sounds.front();
  }
  void write_studio(const std::string& sound) {
    test::write_text(paths_.studio(), test::studio_text({{"cap01", {"cam01"}}}) +
                                          "[[sound]]\nnode = 'cap01'\n" +
                                          "device = 'hw:0'\nchannels = 3\n" + sound);
  }
  void write_sound(RealtimeInstant begin, std::optional<sound::WaveTimecode> timecode = {}) {
    write_wave(begin, kRate, recorded_sound(), timecode);
  }
  void write_wave(RealtimeInstant begin, int rate_hz, const std::vector<int32_t>& values,
                  std::optional<sound::WaveTimecode> timecode = {}) {
    auto writer = sound::WaveWriter::create(paths_.sound() / "cap01.wav", {rate_hz, kChannels},
                                            sound::wave_origin(begin, rate_hz, "", ""));
    ASSERT_TRUE(writer);
    ASSERT_TRUE(writer->write(values));
    ASSERT_TRUE(writer->finish(timecode));
  }
  /// The greatest error of the map, s.
  static double error_of(const SoundLedger& sound, int64_t pulses = kPulses, int rate_hz = kRate) {
    double error = 0;
    for (int64_t pulse = 0; pulse < pulses; ++pulse) {
      const double sample = sound.map.sample_of(static_cast<double>(pulse));
      error = std::max(error, std::abs(sample - truth(pulse, rate_hz)) / rate_hz);
    }
    return error;
  }

  const test::TemporaryFolder folder_;
  const TakePaths paths_{folder_ / "kendo-07"};
};

TEST_F(RecordedSounds, have_the_pulses_of_the_pulse_channel_after_a_recovery) {
  write_studio("pulse_channel = 2\ntimecode_channel = 3\n");
  write_sound(kBegin + from_seconds(kClockError));
  EXPECT_THAT(recover_take(paths_).notes, IsEmpty());
  const SoundLedger found = only_sound();
  EXPECT_EQ(found.map_source, "pulse channel");
  EXPECT_EQ(found.missing_edges, 0);
  EXPECT_THAT(error_of(found), Lt(0.1e-3));
  EXPECT_NEAR(found.drift_ppm, 80, 5);
  EXPECT_EQ(found.timecode_source, "ltc");
  EXPECT_EQ(found.first_timecode, "10:00:01:12");
}

// The clocks of sound and PC part by 48 ms, more than a period of the pulses.
TEST_F(RecordedSounds, have_the_right_pulses_after_ten_minutes) {
  constexpr int kSlowRate = 8'000;
  constexpr int64_t kManyPulses = 15'000;
  write_studio("pulse_channel = 2\n");
  write_pulses(kPulses, kManyPulses);
  const auto samples = static_cast<int64_t>(truth(kManyPulses, kSlowRate) + kSlowRate);
  std::vector<int32_t> values(static_cast<size_t>(samples * kChannels));
  add_pulses(values, kManyPulses, kSlowRate);
  write_wave(kBegin, kSlowRate, values);
  EXPECT_THAT(recover_take(paths_).notes, IsEmpty());
  const SoundLedger found = only_sound();
  EXPECT_EQ(found.missing_edges, 0);
  EXPECT_THAT(error_of(found, kManyPulses, kSlowRate), Lt(0.2e-3));
}

TEST_F(RecordedSounds, have_positions_by_the_clocks_of_the_pcs_without_a_pulse_channel) {
  write_studio("");
  write_sound(kBegin + from_seconds(kClockError));
  recover_take(paths_);
  const SoundLedger found = only_sound();
  EXPECT_EQ(found.map_source, "time stamps");
  EXPECT_NEAR(error_of(found), kClockError + 80e-6 * truth(kPulses) / kRate, 0.5e-3);
  EXPECT_THAT(error_of(found), Lt(3e-6 * found.uncertainty_us));
  EXPECT_EQ(found.timecode_source, "none");
}

TEST_F(RecordedSounds, with_ltc_that_begins_3_s_after_the_first_pulse_have_a_first_timecode) {
  write_studio("pulse_channel = 2\ntimecode_channel = 3\n");
  constexpr int64_t kHalfFrame = 960;
  write_wave(kBegin, kRate, recorded_sound(std::llround(4.5 * kRate) + kHalfFrame));
  recover_take(paths_);
  const SoundLedger found = only_sound();
  EXPECT_EQ(found.first_timecode, "09:59:56:24");
  EXPECT_EQ(found.last_timecode, "10:00:16:23");
}

TEST_F(RecordedSounds, without_positions_of_pulses_keep_their_ltc) {
  write_studio("pulse_channel = 2\ntimecode_channel = 3\n");
  std::filesystem::remove(paths_.pulses());
  write_pulses(0, 1);
  write_sound(kBegin);
  recover_take(paths_);
  const SoundLedger found = only_sound();
  EXPECT_EQ(found.map_source, "none");
  EXPECT_EQ(found.timecode_source, "ltc");
  EXPECT_EQ(found.timecode_runs.size(), 1U);
  EXPECT_EQ(found.first_timecode, "");
}

TEST_F(RecordedSounds, without_ltc_have_no_timecode_although_its_rate_is_known) {
  write_studio("pulse_channel = 2\ntimecode_channel = 1\ntimecode_rate = '25'\n");
  write_sound(kBegin);
  recover_take(paths_);
  const SoundLedger found = only_sound();
  EXPECT_EQ(found.map_source, "pulse channel");
  EXPECT_EQ(found.timecode_source, "none");
}

TEST_F(RecordedSounds, that_were_finished_before_the_kill_have_positions_by_the_wall_clock) {
  write_studio("");
  write_sound(kBegin, sound::WaveTimecode{.samples_since_midnight = 36'000LL * kRate});
  EXPECT_THAT(recover_take(paths_).notes, IsEmpty());
  const SoundLedger found = only_sound();
  EXPECT_NEAR(error_of(found), 80e-6 * truth(kPulses) / kRate, 0.5e-3);
}

TEST_F(RecordedSounds, beside_pulses_with_impossible_times_have_the_others) {
  write_studio("pulse_channel = 2\n");
  {
    EventLogWriter pulses(paths_.pulses(), LogOpening::kContinue);
    for (const int64_t ns :
         {std::numeric_limits<int64_t>::min(), int64_t{-1}, std::numeric_limits<int64_t>::max()}) {
      wire::PulseMessage message = message_of(kPulses);
      message.edge = from_ns<Realtime>(ns);
      ASSERT_TRUE(pulses.write(message));
    }
  }
  write_sound(kBegin);
  recover_take(paths_);
  const SoundLedger found = only_sound();
  EXPECT_THAT(error_of(found), Lt(0.1e-3));
}

TEST_F(RecordedSounds, are_read_with_reports_of_progress) {
  write_studio("");
  write_sound(kBegin);
  recover_take(paths_);
  std::vector<SoundLedger> sounds = {only_sound()};
  int64_t reports = 0, of_pulses = 0;
  read_pulses(paths_.pulses(), [&] { ++of_pulses; });
  EXPECT_THAT(map_recorded_sounds(paths_, sounds, [&] { ++reports; }), IsEmpty());
  EXPECT_GE(of_pulses, kPulses);
  EXPECT_GT(reports, of_pulses + 10) << "for each block of a tenth of a second, too";
}

TEST_F(RecordedSounds, of_another_hour_get_no_map_and_a_line_with_the_cause) {
  write_studio("");
  write_sound(kBegin + std::chrono::hours(1));
  EXPECT_THAT(recover_take(paths_).notes,
              ElementsAre(HasSubstr("cap01.wav: no pulse of the take is within its time")));
  const SoundLedger found = only_sound();
  EXPECT_FALSE(found.map.is_known());
  EXPECT_GT(found.samples, 0);
}

}  // namespace
}  // namespace v3d::take
