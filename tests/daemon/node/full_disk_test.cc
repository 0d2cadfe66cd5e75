// Closing and recovering a take on a full disk, a small file system that the test mounts.
#include <gtest/gtest.h>

#include "daemon/captured/take_disk.h"
#include "daemon/node/take_folder.h"
#include "support/begun_take.h"
#include "support/small_disk.h"
#include "support/temporary_folder.h"
#include "take/ledger/verify.h"
#include "take/logs/frame_log.h"

namespace v3d::node {
namespace {

/// A take without a pulse, on a disk of 20 MB.
class FullDisk : public testing::Test {
 protected:
  FullDisk() {
    studio_.storage.takes = folder_ / "takes";
    std::filesystem::create_directories(paths().folder);
    EXPECT_TRUE(save_take_info(paths(), info_));
  }
  void SetUp() override { ASSERT_TRUE(disk_.is_mounted()); }

  take::TakePaths paths() const { return take_paths(studio_, info_.name); }

  const test::TemporaryFolder folder_;
  const test::SmallDisk disk_{folder_ / "takes", 20'000'000};
  const take::TakeInfo info_ = test::begun_take({});
  Studio studio_;
};

TEST_F(FullDisk, has_reserved_space_for_the_ledger) {
  const take::Ledger ledger{.take = "kendo-07", .commanded = 3, .sensed = 3, .cameras = {}};
  {
    const captured::TakeDisk reserve(
        paths(), {.rate_hz = 25, .bytes_per_pulse = 1, .pulses = 3, .queue_frames = 1});
    disk_.leave(0);
    EXPECT_FALSE(close_take(studio_, info_, ledger));
  }
  EXPECT_TRUE(close_take(studio_, info_, ledger));
  EXPECT_EQ(take::load_ledger(paths().ledger()).commanded, 3);
}

TEST_F(FullDisk, has_reserved_space_for_the_recovery_of_a_take_whose_daemon_was_killed) {
  ASSERT_TRUE(take::EventLogWriter(paths().pulses()).write(wire::PulseMessage()));
  test::write_text(paths().reserve(), std::string(4 << 20, 'r'));
  disk_.leave(0);
  recover_take(paths());
  EXPECT_EQ(take::load_ledger(paths().ledger()).commanded, 1);
}

}  // namespace
}  // namespace v3d::node
