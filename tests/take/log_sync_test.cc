// Periodic sync of event logs.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cerrno>
#include <optional>
#include <thread>

#include "base/core/time.h"
#include "recording.h"
#include "support/child_process.h"
#include "support/fsync_hook.h"
#include "support/temporary_folder.h"
#include "take/logs/frame_log.h"

namespace v3d::take {
namespace {

using testing::HasSubstr;

class LogSync : public testing::Test {
 protected:
  io::Status write() { return log_.write(test::recorded_frame("cam07", pulse_++, {64, 48})); }

  const test::TemporaryFolder folder_;
  test::FsyncHook hook_;
  EventLogWriter log_{folder_ / "cam07.lcmlog"};
  int64_t pulse_ = 0;
};

TEST_F(LogSync, runs_after_an_event_in_another_thread_without_a_further_event) {
  for (const int sync : {1, 2}) {
    EXPECT_TRUE(write());
    ASSERT_TRUE(hook_.wait_for(sync)) << "no other event follows";
    EXPECT_EQ(hook_.bytes(), log_.bytes());
    EXPECT_NE(hook_.thread(), std::this_thread::get_id());
  }
}

TEST_F(LogSync, does_not_block_the_writer) {
  hook_.hold(true);
  EXPECT_TRUE(write());
  EXPECT_TRUE(hook_.wait_for(1)) << "the sync is blocked";
  EXPECT_TRUE(write());
  EXPECT_FALSE(hook_.is_stuck()) << "write() waited for the sync";
  hook_.hold(false);
  EXPECT_TRUE(log_.sync());
}

TEST_F(LogSync, fails_every_later_write_and_sync_after_an_error) {
  for (const int error : {EIO, ESTALE, ENXIO, ETIMEDOUT}) {
    EventLogWriter log(folder_ / (std::to_string(error) + ".lcmlog"), LogOpening::kNew,
                       LogHashing::kChecksum, std::chrono::milliseconds(10));
    hook_.fail_next(error);
    const auto fails = [&] { return !log.write(test::recorded_frame("cam07", 0, {64, 48})); };
    ASSERT_TRUE(test::becomes_true(fails, test::within(10))) << error;
    EXPECT_TRUE(fails());
    const io::Status synced = log.sync();
    ASSERT_FALSE(synced);
    EXPECT_THAT(synced.error().message, HasSubstr("cannot sync " + log.path().string()));
  }
}

TEST_F(LogSync, fails_at_the_close_after_an_error_of_a_running_sync) {
  hook_.hold(true);
  hook_.fail_next(EIO);
  EXPECT_TRUE(write());
  ASSERT_TRUE(hook_.wait_for(1)) << "the sync is blocked";
  hook_.hold(false);
  EXPECT_FALSE(log_.sync()) << "the kernel reports the error to one sync only";
}

TEST_F(LogSync, fails_when_only_the_last_sync_fails) {
  EXPECT_TRUE(write());
  ASSERT_TRUE(hook_.wait_for(1)) << "the periodic sync succeeds";
  hook_.fail_next(EIO);
  const io::Status synced = log_.sync();
  ASSERT_FALSE(synced);
  EXPECT_EQ(synced.error().code, EIO);
}

TEST_F(LogSync, is_not_repeated_without_a_report_when_the_log_is_destroyed) {
  std::optional<EventLogWriter> log(std::in_place, folder_ / "cam08.lcmlog", LogOpening::kNew,
                                    LogHashing::kChecksum, std::chrono::hours(1));
  EXPECT_TRUE(log->write(test::recorded_frame("cam08", 0, {64, 48})));
  EXPECT_TRUE(log->sync());
  const int syncs = hook_.syncs();
  log.reset();
  EXPECT_EQ(hook_.syncs(), syncs) << "no caller receives an error of this sync";
}

TEST_F(LogSync, syncs_unsynced_events_when_the_log_is_destroyed) {
  std::optional<EventLogWriter> log(std::in_place, folder_ / "cam08.lcmlog", LogOpening::kNew,
                                    LogHashing::kChecksum, std::chrono::hours(1));
  EXPECT_TRUE(log->write(test::recorded_frame("cam08", 0, {64, 48})));
  log.reset();
  EXPECT_EQ(hook_.syncs(), 1);
}

TEST_F(LogSync, succeeds_where_the_file_system_does_not_support_it) {
  for (const int error : {EINVAL, ENOSYS, EOPNOTSUPP}) {
    EXPECT_TRUE(write());
    hook_.fail_next(error);
    EXPECT_TRUE(log_.sync()) << error;
    EXPECT_TRUE(write()) << error;
  }
}

}  // namespace
}  // namespace v3d::take
