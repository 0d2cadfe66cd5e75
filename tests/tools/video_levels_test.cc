#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "v3dctl/export/volume_export.h"

namespace v3d::ctl {
namespace {

struct Case {
  int side;
  double rate_hz;
  std::string h264, av1;
};

TEST(VideoLevels, are_the_lowest_that_include_size_and_rate_of_the_pictures) {
  const std::vector<Case> cases{
      {128, 25, "avc1.640028", "av01.0.08M.08"},   {2048, 25, "avc1.640032", "av01.0.12M.08"},
      {2048, 120, "avc1.640034", "av01.0.13M.08"}, {4096, 25, "avc1.64003c", "av01.0.16M.08"},
      {5968, 25, "avc1.64003c", "av01.0.16M.08"},  {5968, 60, "avc1.64003d", "av01.0.17M.08"},
  };
  for (const Case& expected : cases) {
    const auto h264 = h264_level(expected.side, expected.rate_hz);
    const auto av1 = av1_level(expected.side, expected.rate_hz);
    ASSERT_TRUE(h264 && av1) << expected.side;
    EXPECT_EQ(h264->codec, expected.h264) << expected.side << " at " << expected.rate_hz;
    EXPECT_EQ(av1->codec, expected.av1) << expected.side << " at " << expected.rate_hz;
  }
  EXPECT_EQ(h264_level(4096, 25)->name, "6.0");
}

TEST(VideoLevels, end_at_a_side_that_depends_on_the_rate) {
  EXPECT_EQ(max_video_side(25), 5968);
  EXPECT_EQ(max_video_side(1000), 2064);
  EXPECT_FALSE(h264_level(5970, 25));
  EXPECT_TRUE(av1_level(5970, 25));
  EXPECT_FALSE(av1_level(5972, 25));
}

}  // namespace
}  // namespace v3d::ctl
