// Sound of a take, recorded by the real daemon from a simulated device.
#include <gmock/gmock.h>
#include <signal.h>

#include <nlohmann/json.hpp>

#include "sound/wave_file.h"
#include "studio4.h"
#include "take/ledger/ledger.h"
#include "take/ledger/verify.h"

namespace v3d::test {
namespace {

using testing::AnyOf;
using testing::DoubleNear;
using testing::Ge;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Optional;
using testing::SizeIs;

constexpr int kRate = 48'000;
constexpr int64_t kPulses = 60;

struct SoundStudioOptions {
  std::string device = "simulated:ppm=80";
  int rate_hz = kRate;
  std::string pulse_rate = "20";         ///< Hz
  std::vector<std::string> simulator{};  ///< further options of v3d-sim
};

/// Four cameras and a sound device whose clock is 80 ppm fast.
class SoundStudio : public Studio4 {
 protected:
  explicit SoundStudio(const SoundStudioOptions& options = {})
      : Studio4({.more = "[[sound]]\nnode = 'cap01'\nchannels = 3\npulse_channel = 2\n"
                         "timecode_channel = 3\nrate_hz = " +
                         std::to_string(options.rate_hz) + "\ndevice = '" + options.device + "'\n",
                 .rate = options.pulse_rate,
                 .simulator = options.simulator}) {}

  /// The output of a check. It ends with 3 where a busy machine lost a frame.
  std::string check(const std::vector<std::string>& more) {
    std::vector<std::string> line = {bin("v3dctl"), "--studio", folder_ / "studio.toml", "check"};
    line.insert(line.end(), more.begin(), more.end());
    std::filesystem::remove(folder_ / "check.log");  // of an earlier call
    ChildProcess v3dctl(line, folder_ / "check.log");
    EXPECT_THAT(v3dctl.wait(within(60)), Optional(AnyOf(0, 3))) << v3dctl.output() << log();
    return v3dctl.output();
  }
};

/// The same at 96 kHz.
class HighRateSoundStudio : public SoundStudio {
 protected:
  static constexpr int kHighRate = 96'000;
  HighRateSoundStudio() : SoundStudio({.rate_hz = kHighRate}) {}
};

TEST_F(HighRateSoundStudio, a_take_has_the_sound_and_the_sample_of_every_pulse) {
  ASSERT_TRUE(reaches("cap01", "sound_open_flag", 1));
  arm_and_start(kPulses);
  ASSERT_TRUE(becomes_idle()) << log();
  const take::Verification verified = verify_take(take());
  EXPECT_THAT(verified.disagreements, IsEmpty());
  ASSERT_THAT(verified.ledger.sounds, SizeIs(1));
  const take::SoundLedger& sound = verified.ledger.sounds[0];
  EXPECT_EQ(sound.file, "sound/cap01.wav");
  EXPECT_EQ(sound.rate_hz, kHighRate);
  EXPECT_THAT(sound.samples, Ge(kPulses * kHighRate / 20));
  EXPECT_EQ(sound.map_source, "pulse channel");
  // The simulated device has already delivered the samples of an edge that is 300 ms late.
  EXPECT_LE(static_cast<double>(sound.missing_edges), value("cap01", "trigger_late"));
  const double apart = sound.map.sample_of(kPulses - 1) - sound.map.sample_of(0);
  EXPECT_THAT(apart, DoubleNear((kPulses - 1) * kHighRate / 20.0 * (1 + 80e-6), 10));
  EXPECT_EQ(sound.timecode_source, "ltc");
  EXPECT_THAT(sound.first_timecode, HasSubstr("10:"));
  EXPECT_EQ(sound.timecode_jumps, 0);
  // The pulse is where the map says.
  auto wave = sound::WaveReader::open(take().folder / sound.file);
  ASSERT_TRUE(wave);
  ASSERT_EQ(wave->samples(), sound.samples);
  // The simulated timecode begins with the device, before the file.
  const sound::WaveOrigin& origin = wave->origin();
  EXPECT_THAT(origin.timecode_rate, Optional(sound::TimecodeRate::k25));
  EXPECT_THAT(origin.samples_since_midnight, Ge(36'000LL * kHighRate));
  EXPECT_THAT(run_v3dctl({"takes"}, 0), HasSubstr("timecode " + sound.first_timecode + " to "));
  for (const int64_t pulse : {int64_t{0}, kPulses / 2, kPulses - 1}) {
    const auto edge = std::llround(sound.map.sample_of(static_cast<double>(pulse)));
    const auto values = wave->read(edge - 10, 30);
    ASSERT_TRUE(values);
    EXPECT_LT((*values)[3 * 0 + 1], 1 << 20) << pulse;
    EXPECT_GT((*values)[3 * 25 + 1], 1 << 29) << pulse;
  }
}

TEST_F(SoundStudio, a_killed_daemon_leaves_the_sound_for_the_recovery) {
  ASSERT_TRUE(reaches("cap01", "sound_open_flag", 1));
  arm_and_start(0);
  // The sound begins before the pulses, which map it.
  ASSERT_TRUE(reaches("cap01", "pulses_sensed", 20)) << log();
  ASSERT_TRUE(reaches("cap01", "sound_samples", value("cap01", "sound_samples") + kRate)) << log();
  const auto reported = static_cast<int64_t>(value("cap01", "sound_samples"));
  captured_->signal(SIGKILL);
  captured_->wait(within(10));
  const auto wave = sound::WaveReader::open(take().sound() / "cap01.wav");
  ASSERT_TRUE(wave) << wave.error().message;
  EXPECT_THAT(wave->samples(), Ge(reported));
  start_captured();  // recovers the take: its trigger is here, so the train has ended
  EXPECT_TRUE(becomes_true(
      [&] { return load_take_info(take()).state == take::TakeState::kRecovered; }, within(60)));
  ASSERT_TRUE(becomes_idle()) << log();  // the reconstruction node has closed its mesh file, too
  const take::Verification verified = verify_take(take());
  EXPECT_THAT(verified.disagreements, IsEmpty());
  ASSERT_THAT(verified.ledger.sounds, SizeIs(1));
  EXPECT_EQ(verified.ledger.sounds[0].samples, wave->samples());
  EXPECT_EQ(verified.ledger.sounds[0].map_source, "pulse channel");
  EXPECT_EQ(verified.ledger.sounds[0].timecode_source, "ltc");
}

/// The performer stops 0.4 periods, 40 ms, after pulse 30 of the first train after the background;
/// a clap sounds 77 ms after this pulse. At 10 Hz: all cameras must have the pulses around it.
class ClapStudio : public SoundStudio {
 protected:
  ClapStudio()
      : SoundStudio(
            {.device = "simulated:clap_ms=77,clap_edge=" + std::to_string(kEmptyPulses + 31),
             .pulse_rate = "10",
             .simulator = {"--clap", "30.4"}}) {}
};

TEST_F(ClapStudio, gets_the_delay_of_the_sound_from_the_check) {
  ASSERT_TRUE(reaches("cap01", "sound_open_flag", 1));
  const std::string text = check({"--json", "--pulses", "50"});
  const auto report = nlohmann::json::parse(text.substr(text.find('{')));
  ASSERT_THAT(report["sounds"], SizeIs(1)) << text;
  const auto& sound = report["sounds"][0];
  EXPECT_EQ(sound["node"], "cap01");
  ASSERT_TRUE(sound["sound_pulse"].is_number()) << text;
  EXPECT_NEAR(sound["sound_pulse"], 30 + 77.0 / 100, 0.05);
  EXPECT_THAT(sound["cameras"], SizeIs(4)) << text;
  const double uncertainty_ms = sound["uncertainty_ms"];
  EXPECT_NEAR(uncertainty_ms, 50, 2);
  EXPECT_NEAR(sound["offset_ms"], 37, uncertainty_ms);
  for (const auto& camera : sound["cameras"]) {
    EXPECT_NEAR(camera["offset_ms"], 37, 100) << "within a pulse: " << camera;
  }
  EXPECT_THAT(check({"--pulses", "10"}), HasSubstr("sound of cap01: no clap found"));
}

/// At 5 Hz, a busy machine records whole takes.
class AbsentSoundStudio : public SoundStudio {
 protected:
  AbsentSoundStudio() : SoundStudio({.device = "hw:CARD=NoSuchCard", .pulse_rate = "5"}) {}
};

TEST_F(AbsentSoundStudio, a_sound_device_that_is_absent_does_not_stop_the_pictures) {
  EXPECT_TRUE(becomes_true(
      [&] { return log().find("cannot open hw:CARD=NoSuchCard") != std::string::npos; },
      within(60)))
      << "an event names the device";
  arm_and_start(20);
  ASSERT_TRUE(becomes_idle()) << log();
  const take::Verification verified = verify_take(take());
  EXPECT_TRUE(verified.whole());
  EXPECT_THAT(verified.ledger.sounds, IsEmpty());
  EXPECT_THAT(verified.ledger.nodes_without_sound, testing::ElementsAre("cap01"));
  EXPECT_THAT(check({"--pulses", "10"}),
              HasSubstr("sound of cap01: cannot open hw:CARD=NoSuchCard"));
}

}  // namespace
}  // namespace v3d::test
