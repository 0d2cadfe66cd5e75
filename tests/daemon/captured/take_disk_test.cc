#include "daemon/captured/take_disk.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/core/error.h"
#include "support/message_of.h"
#include "support/temporary_folder.h"

namespace v3d::captured {
namespace {

using testing::HasSubstr;

/// 15 cameras of 1024x768.
DiskDemand xga(std::optional<int64_t> pulses) {
  return {
      .rate_hz = 25, .bytes_per_pulse = 15.0 * 1024 * 768, .pulses = pulses, .queue_frames = 32};
}

TEST(SpaceShortage, states_needed_and_free_space_and_what_fits) {
  EXPECT_EQ(space_shortage(xga({}), 12.1e9),
            "needs 88.5 GB for 5 min, 12.1 GB free (room for 39 s: arm with --pulses 993, or make "
            "room: v3dctl takes)");
  EXPECT_EQ(space_shortage(xga(7500), 0.1e9),
            "needs 88.5 GB for 7,500 pulses, 100 MB free (make room: v3dctl takes)");
}

TEST(SpaceShortage, is_empty_when_frames_in_flight_and_the_ledger_fit_too) {
  const double frames = 7500 * 15.0 * 1024 * 768;
  const double besides = 32 * 15.0 * 1024 * 768 + (4 << 20);
  EXPECT_EQ(space_shortage(xga(7500), frames + besides), "");
  EXPECT_NE(space_shortage(xga(7500), frames + besides - 1), "");
  EXPECT_EQ(space_shortage(xga({}), frames + besides), "");
}

TEST(SpaceShortage, is_reported_for_a_node_without_cameras) {
  const DiskDemand none{.rate_hz = 25, .bytes_per_pulse = 0, .pulses = 100, .queue_frames = 32};
  EXPECT_EQ(space_shortage(none, 5e6), "");
  EXPECT_THAT(space_shortage(none, 1e6), HasSubstr("make room"));
}

TEST(CheckDisk, rejects_a_folder_that_does_not_exist) {
  EXPECT_THAT(test::message_of<InputError>([] { check_disk("/nowhere/takes", xga(1)); }),
              HasSubstr("/nowhere/takes: no such folder; is its disk mounted?"));
}

TEST(FolderFault, names_a_folder_of_takes_that_is_missing_or_a_file) {
  const test::TemporaryFolder folder;
  EXPECT_EQ(folder_fault(folder.path()), "");
  EXPECT_EQ(folder_fault(folder / "takes"),
            (folder / "takes").string() + ": no such folder; is its disk mounted?");
  test::write_text(folder / "file", "");
  EXPECT_THAT(folder_fault(folder / "file"), HasSubstr("no such folder"));
}

class TakeDiskTest : public testing::Test {
 protected:
  TakeDiskTest() {
    std::filesystem::create_directories(paths_.folder);
    test::write_text(paths_.info(), "");
  }
  const test::TemporaryFolder folder_;
  const take::TakePaths paths_{folder_ / "kendo-07"};
};

TEST_F(TakeDiskTest, reserves_space_until_the_ledger_is_written) {
  {
    const TakeDisk disk(paths_, xga({}));
    EXPECT_EQ(std::filesystem::file_size(paths_.reserve()), 4U << 20);
  }
  EXPECT_FALSE(std::filesystem::exists(paths_.reserve()));
}

TEST_F(TakeDiskTest, warns_from_a_half_full_to_a_nearly_empty_queue) {
  TakeDisk disk(paths_, xga({}));
  EXPECT_EQ(disk.queue_warning(15), "");
  const std::string warning = disk.queue_warning(16);
  EXPECT_THAT(warning, HasSubstr("frames wait to be written"));
  EXPECT_EQ(disk.queue_warning(4), warning);
  EXPECT_EQ(disk.queue_warning(3), "");
  EXPECT_EQ(disk.queue_warning(15), "");
}

TEST_F(TakeDiskTest, reports_frames_not_written_and_frames_lost) {
  const TakeDisk disk(paths_,
                      {.rate_hz = 1, .bytes_per_pulse = 1, .pulses = {}, .queue_frames = 1});
  EXPECT_EQ(disk.warning({}), "");
  EXPECT_THAT(disk.warning({.dropped = 3, .failed = 0}), HasSubstr("3 frames lost"));
  EXPECT_THAT(disk.warning({.dropped = 3, .failed = 2}), HasSubstr("2 frames not written"));
}

TEST_F(TakeDiskTest, stops_the_take_when_frames_in_flight_would_not_fit) {
  DiskDemand demand = xga({});
  EXPECT_EQ(TakeDisk(paths_, demand).stop_reason({}), "");
  demand.bytes_per_pulse = 1e18;
  EXPECT_THAT(TakeDisk(paths_, demand).stop_reason({}), HasSubstr("is nearly full"));
}

TEST_F(TakeDiskTest, expects_more_bytes_when_cameras_are_opened_after_the_take) {
  DiskDemand demand = xga({});
  demand.bytes_per_pulse = 0;  // no camera was opened yet
  TakeDisk disk(paths_, demand);
  EXPECT_EQ(disk.stop_reason({}), "");
  disk.expect(1e18);
  disk.expect(0);  // one is reopened
  EXPECT_THAT(disk.stop_reason({}), HasSubstr("is nearly full"));
  EXPECT_THAT(disk.warning({}), HasSubstr("full in less than"));
}

TEST_F(TakeDiskTest, stops_the_take_after_a_write_error) {
  const TakeDisk disk(paths_, xga({}));
  EXPECT_EQ(disk.stop_reason({.dropped = 3, .failed = 0}), "");
  EXPECT_THAT(disk.stop_reason({.dropped = 0, .failed = 1}), HasSubstr("is full or broken"));
}

TEST_F(TakeDiskTest, continues_the_take_and_names_the_cause_when_the_free_space_cannot_be_read) {
  const TakeDisk disk(paths_, xga({}), [](const std::filesystem::path& folder) {
    return io::io_error("read the free space of", folder, "Input/output error", EIO);
  });
  EXPECT_EQ(disk.stop_reason({}), "");
  EXPECT_THAT(disk.warning({}), HasSubstr("Input/output error"));
}

TEST_F(TakeDiskTest, reports_a_deleted_take_and_does_not_measure_another_disk) {
  DiskDemand demand = xga({});
  demand.bytes_per_pulse = 1e18;
  const TakeDisk disk(paths_, demand);
  std::filesystem::remove_all(paths_.folder);
  EXPECT_THAT(disk.warning({}), HasSubstr("the folder of the take is gone"));
  EXPECT_EQ(disk.stop_reason({}), "");
}

}  // namespace
}  // namespace v3d::captured
