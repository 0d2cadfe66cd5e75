#include "v3dctl/takes/node_takes.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <functional>

namespace v3d::ctl {
namespace {

using std::chrono::seconds;
using testing::AllOf;
using testing::HasSubstr;

constexpr Duration kDay = std::chrono::hours(24);

/// A take, or a part of it, with one log of 100 bytes for each camera.
TakeSummary summary(const std::vector<std::string>& cameras, Duration started,
                    uint64_t checksum = 1) {
  TakeSummary summary;
  summary.info.name = "kendo-07";
  summary.info.state = take::TakeState::kComplete;
  summary.info.started = RealtimeInstant(started);
  summary.info.cameras = cameras;
  summary.ledger.emplace();
  for (const std::string& camera : cameras) {
    summary.ledger->files.push_back(
        {.name = camera + ".lcmlog", .bytes = 100, .checksum = checksum});
  }
  return summary;
}

std::string difference(const TakeSummary& part, const TakeSummary& copy) {
  return difference_from_copy(part, "cap01", copy, "/archive/kendo-07");
}

TEST(CopyOfATake, has_the_start_of_one_of_its_parts) {
  const TakeSummary copy = summary({"cam01", "cam02"}, kDay);
  TakeSummary part = summary({"cam01"}, kDay, 2);  // its log was continued since
  EXPECT_EQ(difference(part, copy), "");
  part.ledger.reset();
  EXPECT_EQ(difference(part, copy), "");
}

TEST(CopyOfATake, is_recognized_by_a_log_where_the_clock_of_the_node_is_wrong) {
  const TakeSummary copy = summary({"cam01", "cam02"}, kDay);
  EXPECT_EQ(difference(summary({"cam02"}, 9 * kDay), copy), "");
}

TEST(CopyOfATake, is_recognized_by_a_similar_start_where_no_log_has_a_checksum) {
  const TakeSummary copy = summary({"cam01", "cam02"}, kDay);
  TakeSummary recovered = summary({"cam01"}, kDay + seconds(2));
  recovered.ledger->files.front().checksum.reset();
  EXPECT_EQ(difference(recovered, copy), "");
  EXPECT_EQ(difference(summary({}, kDay + seconds(2)), copy), "") << "the node of the trigger";
}

TEST(CopyOfATake, is_not_one_of_a_take_of_another_day) {
  const TakeSummary copy = summary({"cam01"}, kDay);
  EXPECT_THAT(difference(summary({"cam01"}, 4 * kDay, 2), copy),
              AllOf(HasSubstr("/archive/kendo-07: is another take of this name, of 1970-01-0"),
                    HasSubstr("that of cap01 is of 1970-01-0")));
  TakeSummary recovered = summary({"cam01"}, 4 * kDay);
  recovered.ledger.reset();
  EXPECT_THAT(difference(recovered, copy), HasSubstr("is another take of this name"));
}

/// A PC without a battery starts with the same time every day.
TEST(CopyOfATake, is_not_one_of_a_take_with_a_similar_start_and_other_logs) {
  EXPECT_THAT(difference(summary({"cam01"}, kDay + seconds(2), 2), summary({"cam01"}, kDay)),
              HasSubstr("is another take of this name"));
}

/// A camera that delivered nothing has the same log in every take.
TEST(CopyOfATake, is_not_recognized_by_an_empty_log) {
  TakeSummary part = summary({"cam01"}, 4 * kDay), copy = summary({"cam01"}, kDay);
  for (TakeSummary* empty : {&part, &copy}) empty->ledger->files.front().bytes = 0;
  EXPECT_THAT(difference(part, copy), HasSubstr("is another take of this name"));
}

TEST(CopyOfATake, has_all_cameras_of_each_node) {
  const TakeSummary copy = summary({"cam01", "cam02"}, kDay);
  EXPECT_EQ(difference(summary({"cam03", "cam04"}, kDay + seconds(1)), copy),
            "/archive/kendo-07: lacks cam03, cam04 of cap01; move it to another folder, and repeat "
            "the command");
}

/// The node was collected from while its daemon, which had restarted, read the take to continue it.
TEST(CopyOfATake, is_not_whole_when_a_node_has_continued_the_take_since) {
  const TakeSummary copy = summary({"cam01", "cam02"}, kDay);
  const auto difference_after = [&](const std::function<void(take::Ledger&)>& change) {
    TakeSummary part = summary({"cam01"}, kDay);
    change(*part.ledger);
    return difference(part, copy);
  };
  EXPECT_EQ(difference_after([](take::Ledger& part) {
              part.files.push_back({.name = "cam01.0001.lcmlog", .bytes = 7, .checksum = 3});
              part.files.push_back({.name = "sound/cap01.0001.wav", .bytes = 7, .checksum = 3});
            }),
            "/archive/kendo-07: is a copy from before cap01 continued or recovered the take: lacks "
            "cam01.0001.lcmlog, sound/cap01.0001.wav; move it to another folder, and repeat the "
            "command");
  EXPECT_THAT(difference_after([](take::Ledger& part) { part.files[0].bytes = 101; }),
              HasSubstr(" lacks bytes of cam01.lcmlog;"));
  EXPECT_THAT(difference_after([](take::Ledger& part) { part.commanded = 1; }),
              HasSubstr(" lacks pulses;"));
}

TEST(CopyOfATake, is_not_whole_when_a_node_has_found_more_frames_since) {
  TakeSummary copy = summary({"cam01", "cam02"}, kDay), part = summary({"cam01"}, kDay);
  copy.ledger->cameras = {take::account("cam02", {0}, {}, 1), take::account("cam01", {0}, {}, 1)};
  part.ledger->cameras = {take::account("cam01", {0, 1}, {}, 1)};
  EXPECT_THAT(difference(part, copy), HasSubstr(" lacks frames of cam01;"));
}

TEST(CopyOfATake, may_have_the_pulse_log_of_another_node_and_more_than_its_part) {
  TakeSummary copy = summary({"cam01", "cam02"}, kDay), part = summary({"cam01"}, kDay);
  copy.ledger->commanded = 10;
  copy.ledger->files.front().bytes = 101;  // the disk of the node has lost some
  part.ledger->files.push_back({.name = "pulses.0001.lcmlog", .bytes = 7, .checksum = 3});
  EXPECT_EQ(difference(part, copy), "");
  part.ledger->files.push_back({.name = "cam01.0001.lcmlog", .bytes = 7, .checksum = 3});
  copy.ledger->files.clear();
  EXPECT_EQ(difference(part, copy), "") << "an early version lists no files";
}

TEST(CopyOfATake, is_not_whole_while_a_node_records_the_take_again) {
  TakeSummary part = summary({"cam01"}, kDay);
  part.info.state = take::TakeState::kRecording;
  EXPECT_THAT(difference(part, summary({"cam01"}, kDay)), HasSubstr("before cap01 continued"));
}

}  // namespace
}  // namespace v3d::ctl
