// Tests of the timecode of videos and exported surfaces.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdlib>

#include "support/sounding_take.h"
#include "support/temporary_folder.h"
#include "tools/probed_timecode.h"
#include "v3dctl/scene/scene_sound.h"
#include "v3dctl/scene/scene_video.h"

namespace v3d::ctl {
namespace {

using sound::TimecodeRate;
using testing::HasSubstr;
using testing::IsEmpty;

class SceneTimecodeTest : public testing::Test {
 protected:
  static constexpr double kFrame = 1920;  // samples of a frame at 25 per second
  /// A take of 100 pulses whose pulse 0 has frame `first` of the day, at 25 per second.
  void write_take(const std::string& name, int64_t first) const {
    test::write_sounds_of_ledger(
        {folder_ / name},
        {test::timecoded_sound("ltc", "25", {{1000, first, 1000 + 100 * kFrame, first + 100}})});
  }
  SoundClip clip(const std::string& name, const SceneTake& take = {}) const {
    SoundClip clip{.take = take, .rate_hz = 25, .part = part_of(take, 0, 99)};
    clip.take.take = folder_ / name;
    return clip;
  }
  static std::string text(const std::vector<SoundClip>& clips, double seconds = 0) {
    return scene_timecode(clips, seconds, 25).text;
  }
  static std::string problem(const std::vector<SoundClip>& clips) {
    return scene_timecode(clips, 0, 25).problem;
  }

  const test::TemporaryFolder folder_;
};

TEST_F(SceneTimecodeTest, is_that_of_the_pulse_that_is_shown) {
  write_take("walk", 900'000);
  EXPECT_EQ(text({clip("walk")}), "10:00:00:00");
  EXPECT_EQ(text({clip("walk")}, 1.2), "10:00:01:05");
  EXPECT_EQ(text({clip("walk", {.in_pulse = 30})}), "10:00:01:05");
  EXPECT_EQ(text({clip("walk", {.start_s = -1})}), "10:00:01:00");
}

TEST_F(SceneTimecodeTest, counts_on_where_a_take_is_held) {
  write_take("walk", 900'000);
  EXPECT_EQ(text({clip("walk", {.start_s = 2})}), "09:59:58:00");
  EXPECT_EQ(text({clip("walk")}, 10), "10:00:10:00");
}

TEST_F(SceneTimecodeTest, counts_on_between_the_pulses_of_a_take) {
  write_take("walk", 900'000);
  const std::vector<SoundClip> clips = {clip("walk")};
  EXPECT_EQ(scene_timecode(clips, 0.02, 50).text, "10:00:00:01");
  EXPECT_EQ(scene_timecode(clips, 1.22, 50).text, "10:00:01:11");
}

TEST_F(SceneTimecodeTest, differs_between_takes_by_the_same_time_in_each_picture) {
  write_take("walk", 900'000);
  const std::vector<SoundClip> clips = {clip("walk"), clip("walk", {.start_s = 0.03})};
  for (const double seconds : {0.0, 0.02, 0.04, 0.06}) {
    EXPECT_THAT(scene_timecode(clips, seconds, 50).problem, HasSubstr("walk is at 10:00:00:0"))
        << seconds;
  }
}

TEST_F(SceneTimecodeTest, is_that_of_all_takes_that_have_one) {
  write_take("walk", 900'000);
  write_take("run", 900'050);
  test::write_sounds_of_ledger({folder_ / "silent"}, {});
  EXPECT_EQ(text({clip("walk"), clip("run", {.start_s = 2}), clip("silent")}), "10:00:00:00");
  EXPECT_EQ(text({clip("walk"), clip("run")}), "");
  EXPECT_EQ(problem({clip("walk"), clip("run")}), "walk is at 10:00:00:00, run at 10:00:02:00");
  EXPECT_EQ(text({clip("silent")}), "");
  EXPECT_THAT(problem({clip("silent")}), IsEmpty());
}

TEST_F(SceneTimecodeTest, is_not_defined_for_takes_of_another_speed_and_repeated_ones) {
  write_take("walk", 900'000);
  EXPECT_THAT(problem({clip("walk", {.speed = 0.5})}), HasSubstr("plays at another speed than 1"));
  EXPECT_THAT(problem({clip("walk", {.outside = Outside::kLoop})}), HasSubstr("repeats"));
}

TEST(VideoTimecode, counts_the_pictures_of_the_video) {
  // Half of frame 12 has passed.
  const take::PulseTimecode at{.rate = TimecodeRate::k25, .frames = 900'012.5};
  EXPECT_EQ(video_timecode(at, 25), "10:00:00:12");
  EXPECT_EQ(video_timecode(at, 50), "10:00:00:25");
  EXPECT_EQ(video_timecode(at, 30), "10:00:00:15");
}

TEST(VideoTimecode, drops_numbers_where_the_video_has_the_rate_for_it) {
  const auto frames = static_cast<double>(frame_number({10, 1, 0, 2}, TimecodeRate::k2997Drop));
  const take::PulseTimecode at{.rate = TimecodeRate::k2997Drop, .frames = frames};
  EXPECT_EQ(video_timecode(at, 29.97), "10:01:00;02");
  EXPECT_EQ(video_timecode(at, 59.94), "10:01:00;04");
  EXPECT_EQ(video_timecode(at, 25), "10:01:00:01");
}

TEST_F(SceneTimecodeTest, is_in_the_video) {
  if (std::system("command -v ffmpeg >/dev/null") != 0) GTEST_SKIP() << "there is no ffmpeg";
  const auto probed = [&](const std::string& file, double rate_hz, const std::string& timecode) {
    VideoWriter video(folder_ / file, {64, 48}, rate_hz, {.timecode = timecode});
    for (int n = 0; n < 3; ++n) video.add(Image({64, 48}, PixelFormat::kRGB8));
    video.close();
    return test::probed_timecode(folder_ / file);
  };
  EXPECT_THAT(probed("a.mp4", 25, "10:00:03:12"), HasSubstr("timecode=10:00:03:12"));
  EXPECT_THAT(probed("a.mp4", 25, "10:00:03:12"), HasSubstr("codec_tag_string=tmcd"));
  EXPECT_THAT(probed("b.mp4", 29.97, "10:01:00;02"), HasSubstr("timecode=10:01:00;02"));
  EXPECT_THAT(probed("c.mov", 59.94, "10:01:00;04"), HasSubstr("timecode=10:01:00;04"));
  EXPECT_THAT(probed("d.mkv", 50, "10:01:00:25"), HasSubstr("TIMECODE=10:01:00:25"));
  EXPECT_THAT(probed("e.mp4", 12.5, "10:01:00:12"), HasSubstr("timecode=10:01:00:12"));
  EXPECT_THAT(probed("f.mp4", 25, ""), testing::Not(HasSubstr("timecode")));
}

}  // namespace
}  // namespace v3d::ctl
