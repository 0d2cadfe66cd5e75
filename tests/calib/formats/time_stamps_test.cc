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
  EXPECT_THAT(frame_instants(stamps, "cam_0", 2, "t.csv"), ElementsAre(Pair(0, 0), Pair(1, 1)));
  EXPECT_THAT(frame_instants(stamps, "cam01", 2, "t.csv"), ElementsAre(Pair(1, 0)));
}

TEST(TimeStamps, beyond_the_end_of_the_video_are_counted_from_the_first) {
  const TimeStamps stamps =
      parse_time_stamps("sync_index,port,frame_index\r\n26,3,126\r\n27,3,127\r\n", "t.csv");
  EXPECT_THAT(frame_instants(stamps, "3", 2, "t.csv"), ElementsAre(Pair(0, 26), Pair(1, 27)));
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
