#include "daemon/captured/take_disk.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "support/message_of.h"
#include "support/temporary_folder.h"

namespace v3d {
namespace {

using testing::HasSubstr;

/// 15 cameras of 1024x768.
DiskDemand xga(std::optional<int64_t> pulses) {
  return {
      .rate_hz = 25, .bytes_per_pulse = 15.0 * 1024 * 768, .pulses = pulses, .queue_frames = 32};
}

TEST(LackOfRoom, says_what_is_needed_what_is_there_and_what_would_fit) {
  EXPECT_EQ(lack_of_room(xga({}), 12.1e9),
            "needs 88.5 GB for 5 min, 12.1 GB free (room for 39 s: arm with --pulses 993, or make "
            "room: v3dctl takes)");
  EXPECT_EQ(lack_of_room(xga(7500), 0.1e9),
            "needs 88.5 GB for 7,500 pulses, 100 MB free (make room: v3dctl takes)");
}

TEST(LackOfRoom, is_none_where_the_frames_on_their_way_and_the_ledger_fit_too) {
  const double frames = 7500 * 15.0 * 1024 * 768;
  const double besides = 32 * 15.0 * 1024 * 768 + (4 << 20);
  EXPECT_EQ(lack_of_room(xga(7500), frames + besides), "");
  EXPECT_NE(lack_of_room(xga(7500), frames + besides - 1), "");
  EXPECT_EQ(lack_of_room(xga({}), frames + besides), "");
}

TEST(LackOfRoom, is_told_of_a_node_without_cameras) {
  const DiskDemand none{.rate_hz = 25, .bytes_per_pulse = 0, .pulses = 100, .queue_frames = 32};
  EXPECT_EQ(lack_of_room(none, 5e6), "");
  EXPECT_THAT(lack_of_room(none, 1e6), HasSubstr("make room"));
}

TEST(UnfitDisk, is_one_whose_folder_is_not_there) {
  EXPECT_THAT(test::message_of<InputError>([] { refuse_unfit_disk("/nowhere/takes", xga(1)); }),
              HasSubstr("/nowhere/takes: no such folder; is its disk mounted?"));
}

class TakeDiskTest : public testing::Test {
 protected:
  TakeDiskTest() {
    std::filesystem::create_directories(paths_.folder);
    test::write_text(paths_.info(), "");
  }
  const test::TemporaryFolder folder_;
  const TakePaths paths_{folder_ / "kendo-07"};
};

TEST_F(TakeDiskTest, sets_room_aside_until_the_ledger_is_written) {
  {
    const TakeDisk disk(paths_, xga({}));
    EXPECT_EQ(std::filesystem::file_size(paths_.reserve()), 4U << 20);
  }
  EXPECT_FALSE(std::filesystem::exists(paths_.reserve()));
}

TEST_F(TakeDiskTest, warns_when_half_the_queue_is_full_and_until_it_is_nearly_empty) {
  TakeDisk disk(paths_, xga({}));
  EXPECT_EQ(disk.queue_trouble(15), "");
  const std::string trouble = disk.queue_trouble(16);
  EXPECT_THAT(trouble, HasSubstr("frames wait to be written"));
  EXPECT_EQ(disk.queue_trouble(4), trouble);
  EXPECT_EQ(disk.queue_trouble(3), "");
  EXPECT_EQ(disk.queue_trouble(15), "");
}

TEST_F(TakeDiskTest, tells_what_the_disk_refused_and_what_came_too_fast_for_it) {
  const TakeDisk disk(paths_,
                      {.rate_hz = 1, .bytes_per_pulse = 1, .pulses = {}, .queue_frames = 1});
  EXPECT_EQ(disk.trouble({}), "");
  EXPECT_THAT(disk.trouble({.dropped = 3, .refused = 0}), HasSubstr("3 frames lost"));
  EXPECT_THAT(disk.trouble({.dropped = 3, .refused = 2}), HasSubstr("2 frames refused"));
}

TEST_F(TakeDiskTest, ends_the_take_when_the_frames_on_their_way_would_not_fit) {
  DiskDemand demand = xga({});
  EXPECT_EQ(TakeDisk(paths_, demand).must_end({}), "");
  demand.bytes_per_pulse = 1e18;
  EXPECT_THAT(TakeDisk(paths_, demand).must_end({}), HasSubstr("is nearly full"));
}

TEST_F(TakeDiskTest, ends_the_take_when_it_refuses_frames) {
  const TakeDisk disk(paths_, xga({}));
  EXPECT_EQ(disk.must_end({.dropped = 3, .refused = 0}), "");
  EXPECT_THAT(disk.must_end({.dropped = 0, .refused = 1}), HasSubstr("is full or broken"));
}

TEST_F(TakeDiskTest, whose_take_is_gone_says_so_and_does_not_measure_another_disk) {
  DiskDemand demand = xga({});
  demand.bytes_per_pulse = 1e18;
  const TakeDisk disk(paths_, demand);
  std::filesystem::remove_all(paths_.folder);
  EXPECT_THAT(disk.trouble({}), HasSubstr("the folder of the take is gone"));
  EXPECT_EQ(disk.must_end({}), "");
}

}  // namespace
}  // namespace v3d
