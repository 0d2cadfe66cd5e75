// Tests of the sound of scenes.
#include "v3dctl/scene/scene_sound.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdlib>

#include "support/sounding_take.h"
#include "support/temporary_folder.h"
#include "tools/decoded_sound.h"
#include "v3dctl/scene/scene_video.h"

namespace v3d::ctl {
namespace {

using testing::DoubleNear;
using testing::Each;
using testing::ElementsAre;
using testing::IsEmpty;

constexpr double kRate = kSceneSoundRate;
constexpr double kPulse = 1920;  // samples of a period

class SceneSoundTest : public testing::Test {
 protected:
  /// A take of 100 pulses; pulse 0 is at sample 4800.
  void write_take(const std::string& name, const test::Signal& signal) const {
    const sound::PulseMap map{{{0, 4800}, {100, 4800 + 100 * kPulse}}};
    test::write_sounding_take({folder_ / name}, map, 200'000, 1, signal);
  }
  /// A take with a burst in the middle of pulse 50: its centre is half a period after the edge.
  void write_burst() const {
    write_take("burst", [](int64_t sample, int) {
      return test::burst(static_cast<double>(sample), 4800 + 50.5 * kPulse - 96);
    });
  }
  SoundClip clip(const SceneTake& take, const std::string& name = "burst") const {
    SoundClip clip{.take = take, .rate_hz = 25, .part = part_of(take, 0, 99)};
    clip.take.take = folder_ / name;
    return clip;
  }
  /// The scene time at which the burst is heard, s.
  double burst_s(const SceneTake& take) const {
    SceneSound sound({clip(take)}, 0);
    return test::centre_of_sound(sound.next(10 * kSceneSoundRate)) / kRate;
  }

  const test::TemporaryFolder folder_;
};

TEST_F(SceneSoundTest, is_heard_when_its_pulse_is_shown) {
  write_burst();
  EXPECT_THAT(burst_s({}), DoubleNear(50.5 / 25, 1e-4));
  EXPECT_THAT(burst_s({.start_s = 1.5}), DoubleNear(1.5 + 50.5 / 25, 1e-4));
  EXPECT_THAT(burst_s({.start_s = -1}), DoubleNear(50.5 / 25 - 1, 1e-4));
  EXPECT_THAT(burst_s({.in_pulse = 20}), DoubleNear(30.5 / 25, 1e-4));
  EXPECT_THAT(burst_s({.sound_shift_s = 0.25}), DoubleNear(0.25 + 50.5 / 25, 1e-4));
}

TEST_F(SceneSoundTest, is_stretched_with_its_take_to_20_ms) {
  // Longer than a segment of the stretcher, which may leave shorter sounds out.
  write_take("burst", [](int64_t sample, int) {
    const double t = (static_cast<double>(sample) - (4800 + 50.5 * kPulse)) / kRate;
    return 0.8 * std::exp(-0.5 * std::pow(t / 0.04, 2)) * std::cos(2 * std::numbers::pi * 400 * t);
  });
  for (const double speed : {0.25, 0.5, 0.8, 1.25, 2.0, 4.0}) {
    EXPECT_THAT(burst_s({.start_s = 0.5, .speed = speed}),
                DoubleNear(0.5 + 50.5 / 25 / speed, 0.02))
        << speed;
  }
}

TEST_F(SceneSoundTest, keeps_its_pitch_when_it_is_stretched) {
  write_take("tone", [](int64_t sample, int) {
    return 0.5 * std::sin(2 * std::numbers::pi * 440 * static_cast<double>(sample) / kRate);
  });
  for (const double speed : {0.5, 1.0, 2.0}) {
    SceneSound sound({clip({.speed = speed}, "tone")}, 0.25);
    const auto heard = sound.next(kSceneSoundRate);
    int upwards = 0;
    for (size_t i = 2; i < heard.size(); i += 2) upwards += heard[i - 2] < 0 && heard[i] >= 0;
    EXPECT_NEAR(upwards, 440, 3) << speed;
  }
}

TEST_F(SceneSoundTest, is_silent_outside_of_its_part_unless_the_part_is_repeated) {
  write_take("tone", [](int64_t, int) { return 0.5; });
  const SceneTake part{.start_s = 1, .in_pulse = 10, .out_pulse = 34};  // one second
  SceneSound once({clip(part, "tone")}, 0);
  EXPECT_THAT(once.next(kSceneSoundRate), Each(0.0F));
  EXPECT_THAT(once.next(kSceneSoundRate), Each(testing::FloatNear(0.5F, 1e-3F)));
  EXPECT_THAT(once.next(kSceneSoundRate), Each(0.0F));
  SceneTake repeated = part;
  repeated.outside = Outside::kLoop;
  SceneSound looped({clip(repeated, "tone")}, 0);
  EXPECT_THAT(looped.next(3 * kSceneSoundRate), Each(testing::FloatNear(0.5F, 1e-3F)));
}

TEST_F(SceneSoundTest, begins_a_repeated_part_with_its_in_point) {
  write_burst();
  const SceneTake part{.in_pulse = 50, .out_pulse = 54, .outside = Outside::kLoop};  // 0.2 s
  SceneSound sound({clip(part)}, 0.4);
  for (int pass = 0; pass < 3; ++pass) {
    EXPECT_THAT(test::centre_of_sound(sound.next(kSceneSoundRate / 5)), DoubleNear(kPulse / 2, 2));
  }
}

TEST_F(SceneSoundTest, is_the_sum_of_its_takes_with_their_gains) {
  write_take("a", [](int64_t, int) { return 0.5; });
  write_take("b", [](int64_t, int) { return 0.25; });
  SceneTake quiet{.sound_gain_db = -6.0206};
  SceneSound sound({clip(quiet, "a"), clip({}, "b"), clip({.sound = false}, "a")}, 1);
  EXPECT_THAT(sound.next(10), Each(testing::FloatNear(0.5F, 1e-3F)));
}

TEST_F(SceneSoundTest, names_the_files_that_cannot_be_played_in_step) {
  test::write_sounding_take({folder_ / "torn"}, {}, 1000, 1, [](int64_t, int) { return 0; });
  const SceneSound sound({clip({}, "torn")}, 0);
  EXPECT_TRUE(sound.is_silent());
  EXPECT_THAT(sound.unplayed(), ElementsAre((folder_ / "torn" / "sound/cap01.wav").string()));
}

TEST_F(SceneSoundTest, is_in_step_with_the_pictures_of_a_video) {
  if (std::system("command -v ffmpeg >/dev/null") != 0) GTEST_SKIP() << "there is no ffmpeg";
  write_burst();
  for (const std::string ending : {".mp4", ".webm", ".mkv"}) {
    const auto path = folder_ / ("duel" + ending);
    SceneSound sound({clip({.start_s = 0.1})}, 0);
    {
      const SceneSoundFile file(sound, path, 3);
      VideoWriter video(path, {64, 48}, 25, {.sound = file.path()});
      for (int picture = 0; picture < 75; ++picture) {
        video.add(Image({64, 48}, PixelFormat::kRGB8));
      }
      video.close();
    }
    // Players apply the delay of the encoder, as ffmpeg does.
    const double heard = test::centre_of_sound(test::decoded_sound(path, 2.9 * kRate)) / kRate;
    EXPECT_THAT(heard, DoubleNear(0.1 + 50.5 / 25, 0.005)) << ending;
  }
  std::vector<std::string> left;
  for (const auto& entry : std::filesystem::directory_iterator(folder_.path())) {
    if (entry.path().extension() == ".wav") left.push_back(entry.path());
  }
  EXPECT_THAT(left, IsEmpty()) << "the sound beside the video is removed";
}

}  // namespace
}  // namespace v3d::ctl
