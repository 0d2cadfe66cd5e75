#include "v3dctl/scene/scene_video.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numeric>
#include <sstream>

#include "support/temporary_folder.h"

namespace v3d::ctl {
namespace {

using testing::ElementsAre;

/// Numbers of the pictures that a player can start from, as ffprobe reads them.
std::vector<int64_t> key_pictures_of(const std::filesystem::path& video) {
  const ProcessStream ffprobe({"ffprobe", "-v", "error", "-select_streams", "v:0", "-show_entries",
                               "frame=key_frame", "-of", "csv=p=0", video.string()},
                              ProcessStream::End::kStdout);
  std::string text;
  for (uint8_t byte = 0; ffprobe.read({&byte, 1});) text += static_cast<char>(byte);
  std::vector<int64_t> keys;
  std::istringstream lines(text);
  std::string line;
  for (int64_t picture = 0; std::getline(lines, line);) {
    if (line.empty()) continue;  // ffprobe 5 ends the side data of a picture with an empty line
    if (line.starts_with('1')) keys.push_back(picture);
    ++picture;
  }
  return keys;
}

TEST(FrameRate, is_the_exact_fraction_of_an_ntsc_rate_and_otherwise_the_number) {
  EXPECT_EQ(frame_rate(24000.0 / 1001), "24000/1001");
  EXPECT_EQ(frame_rate(30000.0 / 1001), "30000/1001");
  EXPECT_EQ(frame_rate(120000.0 / 1001), "120000/1001");
  EXPECT_EQ(frame_rate(25), "25.000000");
  EXPECT_EQ(frame_rate(30), "30.000000");
  EXPECT_EQ(frame_rate(29.97), "29.970000");
  EXPECT_EQ(frame_rate(12.5), "12.500000");
}

TEST(KeyPictures, are_those_nearest_to_their_time_and_the_first_that_are_not_before_it) {
  std::vector<int64_t> pictures(200);
  std::iota(pictures.begin(), pictures.end(), 0);
  for (const double rate_hz : {12.5, 25.0, 29.97, 30.0, 60.0, 120.0, 1000.0}) {
    std::istringstream times(key_picture_times(pictures, rate_hz));
    std::string time;
    for (const int64_t picture : pictures) {
      ASSERT_TRUE(std::getline(times, time, ','));
      const double periods = std::stod(time) * rate_hz;
      ASSERT_EQ(std::llround(periods), picture) << rate_hz << " Hz, as ffmpeg 5 chooses";
      ASSERT_EQ(std::llround(std::ceil(periods)), picture) << rate_hz << " Hz, as later ones do";
    }
  }
}

TEST(KeyPictures, are_in_the_video_as_requested) {
  if (!has_program("ffmpeg")) GTEST_SKIP() << "there is no ffmpeg";
  const test::TemporaryFolder folder;
  const Image picture({64, 48}, PixelFormat::kRGB8);
  VideoWriter video(folder / "grey.mp4", {64, 48}, 30, {.key_pictures = {2, 5, 7, 10}});
  for (int n = 0; n < 12; ++n) video.add(picture);
  video.close();
  EXPECT_THAT(key_pictures_of(folder / "grey.mp4"), ElementsAre(0, 2, 5, 7, 10));
}

}  // namespace
}  // namespace v3d::ctl
