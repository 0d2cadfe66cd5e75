// The live silhouette repair with a repair function and a queue of the test.
#include "daemon/recond/live_repair.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>

#include "base/io/file.h"
#include "support/temporary_folder.h"

namespace v3d::recond {
namespace {

using recon::SilhouetteFaultKind;
using testing::IsEmpty;

constexpr ImageSize kSize{16, 8};

class LiveRepairOfTwoCameras : public testing::Test {
 protected:
  /// Repairs a set as the test has planned it.
  std::optional<recon::RepairedFrameSet> repair(recon::FrameSet& set,
                                                const recon::StopRequest& should_stop) {
    began_.push_back(set.pulse);
    waiting_ = waiting_during_repair_;
    if (should_stop()) return std::nullopt;
    recon::RepairedFrameSet repaired{.faults = faults_, .replaced = {}};
    if (!faults_.empty()) repaired.replaced.push_back({"cam02", Mask(kSize)});
    return repaired;
  }
  /// Runs the repair of a pulse while no set waits. Returns the number of replaced masks.
  size_t run(int64_t pulse, size_t waiting = 0) {
    waiting_ = waiting;
    recon::FrameSet set{.pulse = pulse, .frames = {}};
    const LiveRepair::Result result = live_.run(set);
    started_ = result.started;
    return result.replaced.size();
  }

  const test::TemporaryFolder folder_;
  size_t waiting_ = 0;
  size_t waiting_during_repair_ = 0;
  bool started_ = false;  ///< the last repair
  std::vector<int64_t> began_;
  std::vector<recon::SilhouetteFault> faults_ = {
      {1, SilhouetteFaultKind::kMissingPiece, {4, 2, 5, 3}, 12},
      {1, SilhouetteFaultKind::kMissingPiece, {10, 2, 2, 2}, 4}};
  LiveRepair live_{{.cameras = {"cam01", "cam02"},
                    .list = folder_ / "repaired.recon01.txt",
                    .repair = [this](recon::FrameSet& set,
                                     const recon::StopRequest& stop) { return repair(set, stop); }},
                   [this] { return waiting_; }};
};

TEST_F(LiveRepairOfTwoCameras, counts_checked_and_repaired_pulses_and_pixels_by_camera) {
  EXPECT_EQ(run(0), 1U);
  EXPECT_EQ(run(1), 1U);
  faults_.clear();
  EXPECT_EQ(run(2), 0U);
  const RepairCounts counts = live_.counts();
  EXPECT_EQ(counts.checked, 3);
  EXPECT_EQ(counts.repaired, 2);
  EXPECT_EQ(counts.unchecked, 0);
  ASSERT_EQ(counts.cameras.size(), 1U);
  const CameraRepairs& camera = counts.cameras.at("cam02");
  EXPECT_EQ(camera.pulses, 2);
  EXPECT_EQ(camera.pixels, 32);
  EXPECT_EQ(camera.left_out, 0);
  EXPECT_EQ(camera.last_pulse, 1);
  EXPECT_EQ(text_of_last_fault(camera),
            "missing piece of 12 pixels, in the region 5 x 3 at x 4, y 2")
      << "the largest fault of the pulse";
}

TEST_F(LiveRepairOfTwoCameras, leaves_out_a_pulse_behind_which_sets_wait) {
  EXPECT_EQ(run(0, 1), 0U);
  EXPECT_FALSE(started_);
  EXPECT_THAT(began_, IsEmpty());
  EXPECT_EQ(live_.counts().unchecked, 1);
  EXPECT_EQ(live_.counts().stopped, 0);
}

TEST_F(LiveRepairOfTwoCameras, stops_a_repair_when_too_many_sets_wait_and_then_pauses) {
  waiting_during_repair_ = RepairLoadControl::kMaxWaiting;
  for (int64_t pulse = 0; pulse <= RepairLoadControl::kFirstPause + 1; ++pulse) {
    EXPECT_EQ(run(pulse), 0U);
    EXPECT_EQ(started_, std::ranges::count(began_, pulse) == 1) << "a stopped repair took time";
  }
  EXPECT_EQ(began_, (std::vector<int64_t>{0, RepairLoadControl::kFirstPause + 1}));
  const RepairCounts counts = live_.counts();
  EXPECT_EQ(counts.checked, 0);
  EXPECT_EQ(counts.stopped, 2);
  EXPECT_EQ(counts.unchecked, RepairLoadControl::kFirstPause + 2) << "stopped ones too";
  EXPECT_THAT(counts.cameras, IsEmpty());
}

TEST_F(LiveRepairOfTwoCameras, counts_nothing_of_a_warm_up) {
  recon::FrameSet set;
  live_.warm_up(set);
  EXPECT_EQ(began_.size(), 1U);
  EXPECT_EQ(live_.counts().checked, 0);
}

TEST_F(LiveRepairOfTwoCameras, counts_cameras_that_it_leaves_out) {
  faults_ = {{0, SilhouetteFaultKind::kWholeCamera, {0, 0, 16, 8}, 128}};
  run(7);
  EXPECT_EQ(live_.counts().cameras.at("cam01").left_out, 1);
}

TEST_F(LiveRepairOfTwoCameras, lists_the_pulses_with_repaired_meshes) {
  EXPECT_FALSE(file_exists(folder_ / "repaired.recon01.txt"));
  live_.record(3);
  live_.record(12);
  EXPECT_EQ(read_file(folder_ / "repaired.recon01.txt"), "3\n12\n");
  EXPECT_EQ(live_.counts().write_errors, 0);
}

TEST(LiveRepairList, counts_pulses_that_the_disk_cannot_store) {
  LiveRepair live({.cameras = {}, .list = "/proc/no/such/folder/list", .repair = {}},
                  [] { return size_t{0}; });
  live.record(1);
  live.record(2);
  EXPECT_EQ(live.counts().write_errors, 2);
}

}  // namespace
}  // namespace v3d::recond
