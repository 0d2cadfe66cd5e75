// Closing a take on a full disk, a small file system that the test mounts.
#include <gtest/gtest.h>

#include "daemon/captured/take_disk.h"
#include "daemon/node/take_folder.h"
#include "support/begun_take.h"
#include "support/small_disk.h"
#include "support/temporary_folder.h"
#include "take/ledger/verify.h"

namespace v3d::node {
namespace {

TEST(FullDisk, has_reserved_space_for_the_ledger) {
  const test::TemporaryFolder folder;
  const test::SmallDisk disk(folder / "takes", 20'000'000);
  ASSERT_TRUE(disk.is_mounted());
  const take::TakeInfo info = test::begun_take({});
  Studio studio;
  studio.storage.takes = folder / "takes";
  const take::TakePaths paths = take_paths(studio, info.name);
  std::filesystem::create_directories(paths.folder);
  EXPECT_TRUE(save_take_info(paths, info));
  const take::Ledger ledger{.take = "kendo-07", .commanded = 3, .sensed = 3, .cameras = {}};
  {
    const captured::TakeDisk reserve(
        paths, {.rate_hz = 25, .bytes_per_pulse = 1, .pulses = 3, .queue_frames = 1});
    disk.leave(0);
    EXPECT_FALSE(close_take(studio, info, ledger));
  }
  EXPECT_TRUE(close_take(studio, info, ledger));
  EXPECT_EQ(take::load_ledger(paths.ledger()).commanded, 3);
}

}  // namespace
}  // namespace v3d::node
