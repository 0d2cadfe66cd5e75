// A frame log whose last write fails, as on a full disk.
#include <gtest/gtest.h>

#include <cerrno>

#include "recording.h"
#include "support/file_size_limit.h"
#include "support/fsync_hook.h"
#include "support/temporary_folder.h"
#include "take/ledger/take_signature.h"
#include "take/logs/frame_log.h"
#include "take/logs/log_files.h"

namespace v3d::take {
namespace {

class LogWithAFailedWrite : public testing::Test {
 protected:
  LogWithAFailedWrite() {
    EXPECT_TRUE(writer_.write(test::recorded_frame("cam07", 0, {1400, 1000})));
    fail_to_write(1'200'000, {1400, 1000});
  }
  /// Writes a frame of which only the first bytes reach the disk.
  void fail_to_write(int64_t bytes, ImageSize size) {
    const test::FileSizeLimit limit(static_cast<rlim_t>(writer_.bytes() + bytes));
    EXPECT_FALSE(writer_.write(test::recorded_frame("cam07", 1, size)));
  }
  /// Expects that the entry of the ledger has all bytes on the disk, and that readers find the
  /// first frame alone.
  void expect_end_of_file() const {
    TakeFile read = read_take_file(paths_, "cam07.lcmlog", ReadFrom::kPageCache).value();
    EXPECT_GT(read.bytes, writer_.bytes());
    read.changed_ns = 0;
    read.root = hash_take_file(paths_, "cam07.lcmlog", read.bytes)->root;
    EXPECT_EQ(writer_.file(), read);
    const FrameLogReader reader(log_);
    ASSERT_EQ(reader.labels().size(), 1U);
    EXPECT_EQ(reader.labels()[0].pulse, 0);
    EXPECT_EQ(reader.damaged_events(), 0);
    EXPECT_EQ(reader.torn_bytes(), 0);
    const SegmentIndex expected{.bytes = static_cast<uint64_t>(read.bytes),
                                .whole_bytes = static_cast<uint64_t>(writer_.bytes()),
                                .events = 1,
                                .damaged_places = 0};
    EXPECT_EQ(load_segment_index(log_, expected.bytes).value(), expected);
  }

  const test::TemporaryFolder folder_;
  const TakePaths paths_{folder_.path()};
  const std::filesystem::path log_ = paths_.frames("cam07");
  EventLogWriter writer_{log_, LogOpening::kNew, LogHashing::kTree};
};

TEST_F(LogWithAFailedWrite, ends_with_the_bytes_of_the_write_in_its_ledger_and_its_index) {
  ASSERT_TRUE(writer_.end());
  ASSERT_TRUE(writer_.save_index());
  expect_end_of_file();
}

/// The header of the second write claims an event that ends inside of the bytes of the first one.
TEST_F(LogWithAFailedWrite, ends_without_an_event_of_two_failed_writes) {
  fail_to_write(500, {64, 48});
  ASSERT_TRUE(writer_.end());
  ASSERT_TRUE(writer_.save_index());
  expect_end_of_file();
}

TEST_F(LogWithAFailedWrite, counts_the_events_of_its_own_segment_in_the_index) {
  EventLogWriter later(log_, LogOpening::kContinue);
  ASSERT_TRUE(later.write(test::recorded_frame("cam07", 2, {64, 48})));
  {
    const test::FileSizeLimit limit(static_cast<rlim_t>(later.bytes() + 100));
    EXPECT_FALSE(later.write(test::recorded_frame("cam07", 3, {64, 48})));
  }
  ASSERT_TRUE(later.end());
  ASSERT_TRUE(later.save_index());
  const auto bytes = std::filesystem::file_size(later.path());
  EXPECT_EQ(load_segment_index(later.path(), bytes).value()->events, 1);
}

TEST_F(LogWithAFailedWrite, has_no_index_when_a_later_write_replaced_its_bytes) {
  ASSERT_TRUE(writer_.write(test::recorded_frame("cam07", 2, {1400, 1000})));
  ASSERT_TRUE(writer_.end());
  ASSERT_TRUE(writer_.save_index());
  EXPECT_FALSE(std::filesystem::exists(segment_index_path(log_)));
  EXPECT_EQ(writer_.file().bytes, writer_.bytes());
}

/// A recovery does not examine the events of a segment that has an index.
TEST_F(LogWithAFailedWrite, has_no_index_when_its_events_may_not_be_on_the_disk) {
  {
    test::FsyncHook hook;
    hook.fail_next(EIO);
    EXPECT_FALSE(writer_.end());
  }
  EXPECT_TRUE(writer_.save_index());
  EXPECT_FALSE(std::filesystem::exists(segment_index_path(log_)));
}

}  // namespace
}  // namespace v3d::take
