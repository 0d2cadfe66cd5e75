#include "v3dctl/reconstruct/shard_folder.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <nlohmann/json.hpp>
#include <stdexcept>

#include "base/core/error.h"
#include "base/io/file.h"
#include "support/temporary_folder.h"
#include "take/logs/mesh_file.h"

namespace v3d::ctl {
namespace {

using testing::ElementsAre;

TEST(Shards, end_before_the_next_key_frame_and_are_numbered_from_pulse_0) {
  const std::vector<TakeShard> shards = shards_of({3, 24, 25, 49, 50, 120});
  ASSERT_EQ(shards.size(), 4U);
  EXPECT_THAT(shards[0].pulses, ElementsAre(3, 24));
  EXPECT_THAT(shards[1].pulses, ElementsAre(25, 49));
  EXPECT_THAT(shards[2].pulses, ElementsAre(50));
  EXPECT_EQ(shards[3].number, 4);
  EXPECT_TRUE(shards_of({}).empty());
}

class FinishedShard : public testing::Test {
 protected:
  FinishedShard() {
    empty_.cameras = {"cam01", "cam02"};
    empty_.camera_iou.resize(2);
    empty_.stages = {{"segment", {}}, {"total", {}}};
    write(shard_.pulses);
    ReconstructReport made = empty_;
    made.frames = 2;
    made.incomplete = 1;
    made.volume_m3 = {0.1, 1.0 / 3};
    made.vertices = {53'000, 2};
    made.silhouette_iou = {0.5, 0.25, 1e-9};
    made.camera_iou = {{0.5, 0.25}, {1e-9}};
    made.frame_quality = {{25, {0.7, 0.8, 2}}, {26, {0.1, 0.2, 1}}};
    made.silhouette_faults = {
        {26, "cam02", {1, recon::SilhouetteFaultKind::kPulseLate, {4, 5, 6, 7}, 89}}};
    made.stages[1].ms = {12.5, 1.0 / 7};
    made.peak_rss_mb = 321.5;
    made_ = made;
    folder_.save(shard_, made);
  }

  void write(const std::vector<int64_t>& pulses) {
    take::MeshFileWriter file(folder_.mesh(shard_));
    for (const int64_t pulse : pulses)
      EXPECT_TRUE(file.append(pulse, std::vector<uint8_t>(100, 7)));
    EXPECT_TRUE(file.close());
  }
  void damage(const std::filesystem::path& path, size_t at) {
    std::string text = read_file(path);
    text.at(at) = static_cast<char>(text.at(at) ^ 1);
    replace_file(path, text);
  }

  test::TemporaryFolder temporary_;
  const ShardFolder folder_{temporary_ / "."};
  const TakeShard shard_{1, {25, 26}};
  ReconstructReport empty_, made_;
};

TEST_F(FinishedShard, has_no_saved_error_while_one_is_being_written) {
  std::ofstream(folder_.path() / "error-cap01-71.part-71-1") << "the dis";
  EXPECT_EQ(folder_.saved_error(), std::nullopt);
  folder_.save_error("the disk is full");
  EXPECT_EQ(folder_.saved_error(), "the disk is full");
}

TEST_F(FinishedShard, stays_when_the_messages_of_an_earlier_run_are_removed) {
  folder_.save_error("the disk is full");
  std::ofstream(folder_.path() / "task-0.log") << "v3dctl: interrupted\n";
  folder_.remove_messages();
  EXPECT_EQ(folder_.saved_error(), std::nullopt);
  EXPECT_FALSE(std::filesystem::exists(folder_.path() / "task-0.log"));
  EXPECT_TRUE(folder_.find(shard_, empty_));
}

TEST_F(FinishedShard, is_found_with_all_measurements) {
  EXPECT_THAT(folder_.saved(), ElementsAre(1));
  const auto found = folder_.find(shard_, empty_);
  ASSERT_TRUE(found);
  EXPECT_EQ(samples_to_json(*found), samples_to_json(made_));
  EXPECT_EQ(found->silhouette_faults[0].camera, "cam02");
  EXPECT_EQ(found->frame_quality[1].second.coverage, 0.2);
}

TEST_F(FinishedShard, is_not_used_when_it_is_damaged) {
  damage(folder_.mesh(shard_), 70);
  EXPECT_FALSE(folder_.find(shard_, empty_));
}

TEST_F(FinishedShard, is_not_used_when_its_report_is_damaged) {
  const auto path = temporary_ / "shard-000001.json";
  damage(path, read_file(path).find("12.5"));
  EXPECT_FALSE(folder_.find(shard_, empty_));
  replace_file(path, read_file(path).substr(0, 100));
  EXPECT_FALSE(folder_.find(shard_, empty_));
}

TEST_F(FinishedShard, is_not_used_when_it_has_other_pulses) {
  EXPECT_FALSE(folder_.find({1, {25, 26, 27}}, empty_));
}

TEST_F(FinishedShard, lacks_the_pulses_that_are_oversized_and_no_others) {
  folder_.drop(shard_);
  write({25});
  ReconstructReport made = made_;
  made.oversized = {{26, "pulse 26: too large"}};
  folder_.save(shard_, made);
  const auto found = folder_.find(shard_, empty_);
  ASSERT_TRUE(found);
  EXPECT_EQ(found->oversized, made.oversized);
  EXPECT_THAT(pulses_with_meshes(shard_, *found), ElementsAre(25));
  ReconstructReport whole = empty_;
  append(whole, *found);
  EXPECT_EQ(whole.oversized, made.oversized);
  folder_.save(shard_, made_);
  EXPECT_FALSE(folder_.find(shard_, empty_)) << "pulse 26 is lost";
}

TEST_F(FinishedShard, has_its_proxy_or_is_not_used_where_one_is_requested) {
  ReconstructReport empty = empty_, made = made_;
  empty.proxy = {empty_};
  made.proxy = {made_};
  made.proxy[0].vertices = {400, 500};
  EXPECT_FALSE(folder_.find(shard_, empty)) << "no proxy";
  {
    take::MeshFileWriter file(folder_.proxy(shard_));
    for (const int64_t pulse : shard_.pulses)
      EXPECT_TRUE(file.append(pulse, std::vector<uint8_t>(100, 8)));
    EXPECT_TRUE(file.close());
  }
  folder_.save(shard_, made);
  const auto found = folder_.find(shard_, empty);
  ASSERT_TRUE(found);
  EXPECT_EQ(samples_to_json(*found), samples_to_json(made));
  EXPECT_THAT(found->proxy[0].vertices, ElementsAre(400, 500));
  ReconstructReport whole = empty;
  append(whole, *found);
  append(whole, *found);
  EXPECT_THAT(whole.proxy[0].vertices, ElementsAre(400, 500, 400, 500));
  damage(folder_.proxy(shard_), 70);
  EXPECT_FALSE(folder_.find(shard_, empty));
  folder_.drop(shard_);
  EXPECT_FALSE(std::filesystem::exists(folder_.proxy(shard_)));
}

TEST_F(FinishedShard, is_missing_after_it_was_dropped) {
  folder_.drop(shard_);
  EXPECT_TRUE(folder_.saved().empty());
  EXPECT_FALSE(folder_.find(shard_, empty_));
}

TEST_F(FinishedShard, is_not_rejected_as_bad_input_when_another_run_drops_it_before_it_is_saved) {
  folder_.drop(shard_);
  try {
    folder_.save(shard_, made_);
    FAIL() << "saved a shard without its mesh file";
  } catch (const InputError& error) {
    FAIL() << "no retry would follow: " << error.what();
  } catch (const std::runtime_error& error) {
    EXPECT_THAT(error.what(), testing::HasSubstr("shard-000001.v3d"));
  }
  EXPECT_TRUE(folder_.saved().empty());
}

TEST_F(FinishedShard, is_appended_to_the_report_of_the_whole) {
  ReconstructReport whole = empty_;
  append(whole, made_);
  append(whole, made_);
  EXPECT_EQ(whole.frames, 4);
  EXPECT_THAT(whole.volume_m3, ElementsAre(0.1, 1.0 / 3, 0.1, 1.0 / 3));
  EXPECT_THAT(whole.camera_iou[1], ElementsAre(1e-9, 1e-9));
  EXPECT_THAT(whole.stages[1].ms, ElementsAre(12.5, 1.0 / 7, 12.5, 1.0 / 7));
  EXPECT_EQ(whole.silhouette_faults.size(), 2U);
  EXPECT_EQ(whole.peak_rss_mb, 321.5);
}

using LockState = ShardFolderLock::State;

TEST(FolderOfShards, has_one_lock_holder_at_a_time) {
  const test::TemporaryFolder temporary;
  const ShardFolder folder(temporary / ".");
  const ShardFolderLock first(folder);
  EXPECT_EQ(first.state(), LockState::kHeld);
  EXPECT_EQ(ShardFolderLock(folder).state(), LockState::kHeldByAnother);
}

TEST(FolderOfShards, reports_a_lock_that_cannot_be_opened) {
  const test::TemporaryFolder temporary;
  std::filesystem::create_directory(temporary / "lock");
  const ShardFolderLock lock(ShardFolder(temporary.path()));
  EXPECT_EQ(lock.state(), LockState::kUnknown);
  EXPECT_EQ(lock.error(), (temporary / "lock").string() + ": Is a directory");
}

class OtherFolderOfShards : public testing::Test {
 protected:
  OtherFolderOfShards() {
    for (const ShardFolder& folder : {own_, other_}) {
      std::filesystem::create_directory(folder.path());
      folder.save_error("a file of the run");
    }
  }
  bool other_exists() {
    own_.remove_others();
    EXPECT_TRUE(own_.saved_error());
    return other_.saved_error().has_value();
  }

  test::TemporaryFolder take_;
  const ShardFolder own_{take_ / ".shards-1"}, other_{take_ / ".shards-2"};
};

TEST_F(OtherFolderOfShards, is_removed_when_its_lock_is_free) { EXPECT_FALSE(other_exists()); }

TEST_F(OtherFolderOfShards, stays_while_another_run_holds_its_lock) {
  const ShardFolderLock running(other_);
  EXPECT_TRUE(other_exists());
}

TEST_F(OtherFolderOfShards, stays_when_its_lock_cannot_be_opened) {
  std::filesystem::create_directory(other_.path() / "lock");
  EXPECT_TRUE(other_exists());
}

}  // namespace
}  // namespace v3d::ctl
