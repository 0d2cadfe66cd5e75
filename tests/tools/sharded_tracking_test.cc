#include "v3dctl/motion/sharded_tracking.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "base/core/error.h"
#include "base/io/file.h"
#include "common/mesh_formats.h"
#include "recon/shapes.h"
#include "support/message_of.h"
#include "support/temporary_folder.h"
#include "v3dctl/motion/take_motion.h"

namespace v3d::ctl {
namespace {

using testing::ElementsAre;
using testing::HasSubstr;
namespace fs = std::filesystem;

/// Tracks the segments in this process, except that the first `failures` tasks end without one.
class InlineTrackRunner : public TaskRunner {
 public:
  InlineTrackRunner(const TaskFolder& folder, int& failures)
      : folder_(folder.path()), failures_(failures) {}

  void start(const std::vector<int64_t>& /*missing*/, int64_t /*count*/) override {}
  void start_each(const std::vector<take::FrameRange>& ranges) override {
    for (const take::FrameRange& range : ranges) {
      if (failures_ > 0) {
        --failures_;
      } else {
        track_shard(folder_, range, 2);
      }
    }
  }
  bool poll() override { return false; }
  void cancel() override {}
  std::string failure() const override { return {}; }
  std::string hint() const override { return {}; }

 private:
  const TrackFolder folder_;
  int& failures_;
};

/// Eleven meshes of a ball. A second one is on one side at pulses 4 to 6, and on the other one from
/// pulse 7 on.
class TrackByTasks : public testing::Test {
 protected:
  TrackByTasks() {
    request_.input = folder_ / "meshes";
    request_.out = folder_ / "motion.v3d";
    request_.meshes_only = true;
    request_.tracking.triangles = 1000;
    request_.tracking.node_spacing_m = 0.1;
    request_.threads = 2;
    fs::create_directory(request_.input);
    for (int pulse = 0; pulse < 11; ++pulse) {
      Mesh mesh = recon::shapes::sphere({0.01F * static_cast<float>(pulse), 0, 0}, 0.3F, 24);
      if (pulse >= 4 && pulse < 7) {
        recon::shapes::append(mesh, recon::shapes::sphere({1, 0, 0}, 0.35F, 24));
      }
      if (pulse >= 7) recon::shapes::append(mesh, recon::shapes::sphere({-1, 0, 0}, 0.2F, 24));
      write_ply(request_.input / (std::to_string(pulse) + ".ply"), mesh);
    }
  }

  TrackReport track_alone() {
    return track_take(
        request_, [](int64_t) {}, [] {});
  }
  TrackReport track_by_tasks() {
    return track_sharded(
        request_,
        [this](const TaskFolder& folder) {
          return std::make_unique<InlineTrackRunner>(folder, failures_);
        },
        [](int64_t) {}, [] {});
  }
  /// Finishes the segment of the key pulse. Returns the range of pulses of its task.
  recon::SegmentRange track_first_segment(const TrackFolder& folder) const {
    const recon::TakeSurvey survey =
        recon::survey_pulses(source_of(*open_input(request_)).surfaces, 11, [](size_t) {});
    folder.save_survey(survey);
    track_shard(folder, {0, 11}, 2);
    return recon::intervals_of(survey).tracked.at(0);
  }
  std::vector<fs::path> shard_folders() const {
    std::vector<fs::path> folders;
    for (const fs::directory_entry& entry : fs::directory_iterator(folder_.path())) {
      if (entry.path().filename().string().starts_with(".shards-")) folders.push_back(entry.path());
    }
    return folders;
  }
  /// Requires the same file and report as those of one process.
  void expect_same_as_alone() {
    const TrackReport alone = track_alone();
    const std::string bytes = read_file(request_.out);
    fs::remove(request_.out);
    const TrackReport report = track_by_tasks();
    EXPECT_EQ(read_file(request_.out), bytes);
    EXPECT_EQ(report.pulses, alone.pulses);
    EXPECT_EQ(report.full_from, alone.full_from);
    EXPECT_EQ(report.bytes, alone.bytes);
    EXPECT_EQ(report.position_bytes, alone.position_bytes);
    EXPECT_EQ(report.untracked.size(), alone.untracked.size());
    ASSERT_EQ(report.segments.size(), alone.segments.size());
    for (size_t s = 0; s < report.segments.size(); ++s) {
      const TrackedSegmentReport &made = report.segments[s], &expected = alone.segments[s];
      EXPECT_EQ(made.first, expected.first);
      EXPECT_EQ(made.last, expected.last);
      EXPECT_EQ(made.key, expected.key);
      EXPECT_EQ(made.residual_p90_mm, expected.residual_p90_mm);
      ASSERT_EQ(made.residuals.size(), expected.residuals.size());
      EXPECT_EQ(made.residuals.back().second.median_m, expected.residuals.back().second.median_m);
    }
    EXPECT_TRUE(shard_folders().empty());
  }

  const test::TemporaryFolder folder_;
  TrackRequest request_;
  int failures_ = 0;  ///< of the next tasks
};

TEST_F(TrackByTasks, makes_the_file_and_the_report_of_one_process) {
  EXPECT_EQ(track_alone().segments.size(), 3U);
  expect_same_as_alone();
}

TEST_F(TrackByTasks, repeats_a_task_that_ended_without_its_segment) {
  failures_ = 2;
  expect_same_as_alone();
  EXPECT_EQ(failures_, 0);
}

TEST_F(TrackByTasks, ends_the_file_at_the_same_pulse_as_one_process_when_it_is_full) {
  request_.max_bytes = static_cast<uint64_t>(track_alone().bytes - 1);
  ASSERT_TRUE(track_alone().full_from);
  expect_same_as_alone();
}

TEST_F(TrackByTasks, fails_after_three_tries_and_continues_after_the_finished_segments) {
  failures_ = 3;
  EXPECT_THAT(test::message_of<std::runtime_error>([&] { track_by_tasks(); }),
              HasSubstr("1 shard of the take failed 3 times; no task wrote a message"));
  EXPECT_TRUE(shard_folders().empty()) << "no segment was finished";

  const TrackFolder folder = TrackFolder::create(request_);
  const recon::SegmentRange whole = track_first_segment(folder);
  const auto first = folder.find(whole);
  ASSERT_TRUE(first);
  EXPECT_EQ(first->part.report.first, 4);
  testing::internal::CaptureStderr();
  track_by_tasks();
  EXPECT_THAT(testing::internal::GetCapturedStderr(),
              HasSubstr("1 segment kept from an earlier run"));
}

TEST_F(TrackByTasks, continues_where_the_result_and_other_files_are_in_the_folder_of_the_meshes) {
  request_.out = request_.input / "motion.v3d";
  track_first_segment(TrackFolder::create(request_));
  test::write_text(request_.input / "track.log", "interrupted");
  testing::internal::CaptureStderr();
  track_by_tasks();
  EXPECT_THAT(testing::internal::GetCapturedStderr(),
              HasSubstr("1 segment kept from an earlier run"));
}

TEST_F(TrackByTasks, tracks_a_damaged_segment_again) {
  const TrackFolder folder = TrackFolder::create(request_);
  const recon::SegmentRange whole = track_first_segment(folder);
  ASSERT_THAT(folder.saved_shards(), ElementsAre("000000-000011"));
  const fs::path file = folder.shard_file("000000-000011", ".motion");
  std::string bytes = read_file(file);
  bytes.at(100) = static_cast<char>(bytes.at(100) ^ 1);
  replace_file(file, bytes);
  EXPECT_FALSE(folder.find(whole));
  expect_same_as_alone();
}

TEST_F(TrackByTasks, rejects_an_input_without_meshes_as_one_process_does) {
  request_.frames = {11, 12};
  const auto alone = test::message_of<InputError>([&] { track_alone(); });
  EXPECT_EQ(test::message_of<InputError>([&] { track_by_tasks(); }), alone);
  EXPECT_TRUE(shard_folders().empty());
}

}  // namespace
}  // namespace v3d::ctl
