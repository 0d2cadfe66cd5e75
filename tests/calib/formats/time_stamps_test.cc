#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/core/error.h"
#include "calib/formats/text_fields.h"
#include "support/message_of.h"
namespace v3d::calib {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
using testing::Pair;

TEST(TimeStamps, assign_frames_to_instants) {
  const TimeStamps stamps = parse_time_stamps(
      "sync_index,cam_id,frame_index,frame_time\n0,0,0,1.0\n0,1,1,1.0\n1,0,1,1.1\n1,1,,\n",
      "t.csv");
  EXPECT_THAT(frame_instants(stamps, "cam_0", 2, "t.csv").instants,
              ElementsAre(Pair(0, 0), Pair(1, 1)));
  EXPECT_THAT(frame_instants(stamps, "cam01", 2, "t.csv").instants, ElementsAre(Pair(1, 0)));
}

TEST(TimeStamps, beyond_the_end_of_the_video_are_counted_from_the_first) {
  const TimeStamps stamps =
      parse_time_stamps("sync_index,port,frame_index\r\n26,3,126\r\n27,3,127\r\n", "t.csv");
  EXPECT_THAT(frame_instants(stamps, "3", 2, "t.csv").instants,
              ElementsAre(Pair(0, 26), Pair(1, 27)));
}

/// The time stamps of one camera with the instant 5000 + index.
TimeStamps stamps_from(int64_t first, int64_t last) {
  TimeStamps stamps;
  for (int64_t index = first; index <= last; ++index) stamps["2"][index] = 5000 + index;
  return stamps;
}

TEST(TimeStamps, of_frames_that_a_damaged_video_lacks_at_its_end_do_not_shift_the_others) {
  const FrameInstants frames = frame_instants(stamps_from(2, 1000), "cam_2", 1000, "t.csv");
  EXPECT_EQ(frames.instants.begin()->first, 2);
  EXPECT_EQ(frames.instants.at(2), 5002);
  EXPECT_EQ(frames.instants.at(999), 5999);
  EXPECT_EQ(frames.beyond, 1);
}

TEST(TimeStamps, of_another_origin_may_lack_frames) {
  const FrameInstants frames = frame_instants(stamps_from(126, 1120), "cam_2", 1000, "t.csv");
  EXPECT_EQ(frames.instants.at(0), 5126);
  EXPECT_EQ(frames.beyond, 0);
}

TEST(TimeStamps, with_errors_are_reported_with_file_and_line) {
  EXPECT_THAT(test::message_of<InputError>([] { parse_time_stamps("a,b\n", "t.csv"); }),
              HasSubstr("t.csv:1"));
  const std::string header = "sync_index,cam_id,frame_index\n";
  EXPECT_THAT(test::message_of<InputError>([&] { parse_time_stamps(header + "1,0,x\n", "t.csv"); }),
              HasSubstr("t.csv:2"));
  EXPECT_THAT(test::message_of<InputError>([&] { parse_time_stamps(header + "1,0\n", "t.csv"); }),
              HasSubstr("too few columns"));
  EXPECT_THAT(test::message_of<InputError>([&] {
                frame_instants(parse_time_stamps(header + "1,0,1\n", "t.csv"), "cam7", 0, "t.csv");
              }),
              HasSubstr("no time stamps of camera cam7"));
}

}  // namespace
}  // namespace v3d::calib
