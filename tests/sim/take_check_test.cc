// Tests the comparison of takes with the simulator's record.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <functional>

#include "base/core/bytes.h"
#include "sim/small_take.h"
#include "support/temporary_folder.h"
#include "take/logs/frame_log.h"
#include "take/take.h"
#include "v3d-sim/sim_commands.h"

namespace v3d::sim {
namespace {

using test::TemporaryFolder;

/// The exposure record that fits the take in `folder`, so that every label is correct.
std::vector<ExposureLine> record_of(const std::filesystem::path& folder) {
  constexpr int64_t kFirstEdge = 20;
  const take::TakePaths paths{folder};
  std::vector<ExposureLine> record;
  const std::vector<wire::PulseMessage> pulses = take::read_pulses(paths.pulses());
  for (const std::string& camera : load_take_info(paths).cameras) {
    take::FrameLogReader log(paths.frames(camera));
    for (const FrameLabel& label : log.labels()) {
      record.push_back(
          {camera, label.device_time, pulses[static_cast<size_t>(label.pulse)].edge_monotonic,
           kFirstEdge + label.pulse, label.pulse, checksum({log.read(label.pulse)->image.bytes})});
    }
  }
  return record;
}

TEST(TakeCheck, accepts_a_correct_take) {
  const TemporaryFolder folder;
  write(small_take(folder / "cut"));
  const TakeCheck check = check_take(folder / "cut", record_of(folder / "cut"));
  EXPECT_EQ(check.frames_received, 15);
  EXPECT_TRUE(check.whole()) << check.problems.front();
}

TEST(TakeCheck, counts_frames_that_are_written_more_often_than_their_image_was_sent) {
  const TemporaryFolder folder;
  SimulatedTake take = small_take(folder / "cut");
  take.faults = {fault("cam02", 3, FaultKind::kDuplicate)};
  write(take);
  std::vector<ExposureLine> record = record_of(take.folder);
  EXPECT_TRUE(check_take(take.folder, record).whole()) << "the image was sent twice";
  const auto second = std::ranges::adjacent_find(record);
  ASSERT_NE(second, record.end());
  record.erase(second);
  const TakeCheck check = check_take(take.folder, record);
  EXPECT_EQ(check.frames_repeated, 1);
  EXPECT_EQ(check.frames_mislabelled, 0);
  EXPECT_FALSE(check.whole());
  EXPECT_THAT(check.problems, testing::ElementsAre("cam02 edge 23: 2 frames of 1 sent"));
}

TEST(TakeCheck, counts_images_with_other_bytes_than_the_sent_ones) {
  const TemporaryFolder folder;
  write(small_take(folder / "cut"));
  std::vector<ExposureLine> record = record_of(folder / "cut");
  std::swap(record[1].checksum, record[2].checksum);
  const TakeCheck check = check_take(folder / "cut", record);
  EXPECT_EQ(check.images_wrong, 2);
  EXPECT_EQ(check.frames_mislabelled, 0);
  EXPECT_FALSE(check.whole());
  record[1].checksum = record[2].checksum = 0;
  EXPECT_TRUE(check_take(folder / "cut", record).whole()) << "their checksums are not known";
}

TEST(TakeCheck, counts_missing_frames) {
  const TemporaryFolder folder;
  SimulatedTake take = small_take(folder / "cut");
  take.faults = {fault("cam01", 2, FaultKind::kDrop), fault("cam03", 2, FaultKind::kDrop)};
  write(take);
  const TakeCheck check = check_take(take.folder, record_of(take.folder));
  EXPECT_EQ(check.frames_received, 13);
  EXPECT_EQ(check.frames_missing, 2);
  EXPECT_EQ(check.frames_mislabelled, 0);
  EXPECT_FALSE(check.whole());
}

TEST(TakeCheck, counts_frames_that_show_another_edge_than_their_pulse) {
  const TemporaryFolder folder;
  write(small_take(folder / "cut"));
  const std::vector<ExposureLine> right = record_of(folder / "cut");
  const auto mislabelled = [&](const std::function<void(std::vector<ExposureLine>&)>& spoil) {
    std::vector<ExposureLine> record = right;
    spoil(record);
    return check_take(folder / "cut", record).frames_mislabelled;
  };
  // The images of two pulses are swapped.
  EXPECT_EQ(mislabelled([](auto& r) { std::swap(r[1].device_time, r[2].device_time); }), 2);
  // An exposure that is not in the record.
  EXPECT_EQ(mislabelled([](auto& r) { r[7].device_time += Duration(1); }), 1);
  // All frames of a camera are one pulse late.
  EXPECT_EQ(mislabelled([](auto& r) {
              for (size_t i = 0; i < 5; ++i) ++r[i].edge;
            }),
            5);
}

/// Removes the pulse messages from `pulse` on, as if the node had been killed before it wrote them.
void end_pulse_log_before(int64_t pulse, const std::filesystem::path& folder) {
  const take::TakePaths paths{folder};
  const std::vector<wire::PulseMessage> pulses = take::read_pulses(paths.pulses());
  std::filesystem::remove(paths.pulses());
  take::EventLogWriter log(paths.pulses(), take::LogOpening::kNew);
  for (const wire::PulseMessage& message : pulses) {
    if (message.pulse >= pulse) break;
    ASSERT_TRUE(log.write(message));
  }
  ASSERT_TRUE(log.sync());
}

TEST(TakeCheck, accepts_frames_of_pulses_after_the_last_one_of_the_log_only_at_their_times) {
  const TemporaryFolder folder;
  const std::filesystem::path cut = folder / "cut";
  write(small_take(cut));
  std::vector<ExposureLine> record = record_of(cut);
  end_pulse_log_before(3, cut);
  EXPECT_EQ(check_take(cut, record).frames_mislabelled, 0);
  // The frame of pulse 4 of each camera shows the edge of pulse 3.
  for (ExposureLine& line : record) {
    if (line.image_index == 4) line.edge_time -= period_of(take::load_take_info({cut}).rate_hz);
  }
  EXPECT_EQ(check_take(cut, record).frames_mislabelled, 3);
}

TEST(TakeCheck, counts_mislabelled_frames_that_are_not_suspect) {
  const TemporaryFolder folder;
  SimulatedTake take = small_take(folder / "cut");
  take.faults = {fault("cam01", 1, FaultKind::kSuspect)};
  write(take);
  std::vector<ExposureLine> record = record_of(take.folder);
  std::swap(record[1].device_time, record[2].device_time);
  const TakeCheck check = check_take(take.folder, record);
  EXPECT_EQ(check.frames_mislabelled, 2);
  EXPECT_EQ(check.mislabelled_not_suspect, 1);
}

TEST(TakeCheck, reports_a_missing_take) {
  const TemporaryFolder folder;
  EXPECT_NE(refusal([&] { check_take(folder / "absent", {}); }), "");
}

}  // namespace
}  // namespace v3d::sim
