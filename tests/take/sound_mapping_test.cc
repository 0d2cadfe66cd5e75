// Sound files of a take that was not closed: the positions of pulses after the recovery.
#include "take/ledger/sound_mapping.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

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
double truth(int64_t pulse) {
  return (kFirstPulse + static_cast<double>(pulse) / kPulseRate) * kRate * kSampleClock;
}

/// Channel 1 has a tone, channel 2 the pulses, channel 3 timecode from 10:00:00:00 on.
std::vector<int32_t> recorded_sound() {
  const auto samples = static_cast<int64_t>(truth(kPulses) + kRate);
  std::vector<int32_t> values(static_cast<size_t>(samples * kChannels));
  for (int64_t pulse = 0; pulse < kPulses; ++pulse) {
    const auto first = static_cast<int64_t>(std::ceil(truth(pulse)));
    for (int64_t s = first; s < first + 240; ++s) {
      values[static_cast<size_t>(s * kChannels + 1)] = 1 << 30;
    }
  }
  sound::LtcWriter timecode(kRate, sound::TimecodeRate::k25, {.hours = 10});
  for (int64_t s = 0; s < samples;) {
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
    EventLogWriter pulses(paths_.pulses());
    for (int64_t pulse = 0; pulse < kPulses; ++pulse) {
      wire::PulseMessage message;
      message.pulse = pulse;
      message.edge = kBegin + from_seconds(kFirstPulse + static_cast<double>(pulse) / kPulseRate);
      EXPECT_TRUE(pulses.write(message));
    }
  }

  void write_studio(const std::string& sound) {
    test::write_text(paths_.studio(), test::studio_text({{"cap01", {"cam01"}}}) +
                                          "[[sound]]\nnode = 'cap01'\n" +
                                          "device = 'hw:0'\nchannels = 3\n" + sound);
  }
  void write_sound(RealtimeInstant begin, std::optional<sound::WaveTimecode> timecode = {}) {
    auto writer = sound::WaveWriter::create(paths_.sound() / "cap01.wav", {kRate, kChannels},
                                            sound::wave_origin(begin, kRate, "", ""));
    ASSERT_TRUE(writer);
    ASSERT_TRUE(writer->write(recorded_sound()));
    ASSERT_TRUE(writer->finish(timecode));
  }
  /// The greatest error of the map, s.
  static double error_of(const SoundLedger& sound) {
    double error = 0;
    for (int64_t pulse = 0; pulse < kPulses; ++pulse) {
      error = std::max(
          error, std::abs(sound.map.sample_of(static_cast<double>(pulse)) - truth(pulse)) / kRate);
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
  const std::vector<SoundLedger> sounds = load_ledger(paths_.ledger()).sounds;
  ASSERT_EQ(sounds.size(), 1U);
  EXPECT_EQ(sounds[0].map_source, "pulse channel");
  EXPECT_EQ(sounds[0].missing_edges, 0);
  EXPECT_THAT(error_of(sounds[0]), Lt(0.1e-3));
  EXPECT_NEAR(sounds[0].drift_ppm, 80, 5);
  EXPECT_EQ(sounds[0].timecode_source, "ltc");
  EXPECT_EQ(sounds[0].first_timecode, "10:00:01:12");
}

TEST_F(RecordedSounds, have_positions_by_the_clocks_of_the_pcs_without_a_pulse_channel) {
  write_studio("");
  write_sound(kBegin + from_seconds(kClockError));
  recover_take(paths_);
  const std::vector<SoundLedger> sounds = load_ledger(paths_.ledger()).sounds;
  ASSERT_EQ(sounds.size(), 1U);
  EXPECT_EQ(sounds[0].map_source, "time stamps");
  EXPECT_NEAR(error_of(sounds[0]), kClockError + 80e-6 * truth(kPulses) / kRate, 0.5e-3);
  EXPECT_THAT(error_of(sounds[0]), Lt(3e-6 * sounds[0].uncertainty_us));
  EXPECT_EQ(sounds[0].timecode_source, "none");
}

TEST_F(RecordedSounds, that_were_finished_before_the_kill_have_positions_by_the_wall_clock) {
  write_studio("");
  write_sound(kBegin, sound::WaveTimecode{.samples_since_midnight = 36'000LL * kRate});
  EXPECT_THAT(recover_take(paths_).notes, IsEmpty());
  const std::vector<SoundLedger> sounds = load_ledger(paths_.ledger()).sounds;
  ASSERT_EQ(sounds.size(), 1U);
  EXPECT_NEAR(error_of(sounds[0]), 80e-6 * truth(kPulses) / kRate, 0.5e-3);
}

TEST_F(RecordedSounds, of_another_hour_get_no_map_and_a_line_with_the_cause) {
  write_studio("");
  write_sound(kBegin + std::chrono::hours(1));
  EXPECT_THAT(recover_take(paths_).notes,
              ElementsAre(HasSubstr("cap01.wav: no pulse of the take is within its time")));
  const std::vector<SoundLedger> sounds = load_ledger(paths_.ledger()).sounds;
  ASSERT_EQ(sounds.size(), 1U);
  EXPECT_FALSE(sounds[0].map.is_known());
  EXPECT_GT(sounds[0].samples, 0);
}

}  // namespace
}  // namespace v3d::take
