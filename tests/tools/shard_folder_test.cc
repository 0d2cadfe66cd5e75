#include "v3dctl/reconstruct/shard_folder.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "base/file.h"
#include "support/temporary_folder.h"
#include "take/mesh_file.h"

namespace v3d::ctl {
namespace {

using testing::ElementsAre;

TEST(Pieces, end_where_the_next_key_frame_stands_and_are_numbered_from_pulse_0) {
  const std::vector<Piece> pieces = pieces_of({3, 24, 25, 49, 50, 120});
  ASSERT_EQ(pieces.size(), 4U);
  EXPECT_THAT(pieces[0].pulses, ElementsAre(3, 24));
  EXPECT_THAT(pieces[1].pulses, ElementsAre(25, 49));
  EXPECT_THAT(pieces[2].pulses, ElementsAre(50));
  EXPECT_EQ(pieces[3].number, 4);
  EXPECT_TRUE(pieces_of({}).empty());
}

class FinishedPiece : public testing::Test {
 protected:
  FinishedPiece() {
    begun_.cameras = {"cam01", "cam02"};
    begun_.camera_iou.resize(2);
    begun_.stages = {{"segment", {}}, {"total", {}}};
    write(piece_.pulses);
    ReconstructReport made = begun_;
    made.frames = 2;
    made.incomplete = 1;
    made.volume_m3 = {0.1, 1.0 / 3};
    made.vertices = {53'000, 2};
    made.silhouette_iou = {0.5, 0.25, 1e-9};
    made.camera_iou = {{0.5, 0.25}, {1e-9}};
    made.quality = {{25, {0.7, 0.8, 2}}, {26, {0.1, 0.2, 1}}};
    made.silhouette_faults = {
        {26, "cam02", {1, SilhouetteFaultKind::kPulseLate, {4, 5, 6, 7}, 89}}};
    made.stages[1].ms = {12.5, 1.0 / 7};
    made.peak_rss_mb = 321.5;
    made_ = made;
    folder_.save(piece_, made);
  }

  void write(const std::vector<int64_t>& pulses) {
    MeshFileWriter file(folder_.mesh(piece_));
    for (const int64_t pulse : pulses)
      EXPECT_TRUE(file.append(pulse, std::vector<uint8_t>(100, 7)));
    file.close();
  }
  void spoil(const std::filesystem::path& path, size_t at) {
    std::string text = read_file(path);
    text.at(at) = static_cast<char>(text.at(at) ^ 1);
    replace_file(path, text);
  }

  test::TemporaryFolder temporary_;
  const PieceFolder folder_{temporary_ / "."};
  const Piece piece_{1, {25, 26}};
  ReconstructReport begun_, made_;
};

TEST_F(FinishedPiece, is_found_with_every_sample) {
  EXPECT_THAT(folder_.saved(), ElementsAre(1));
  const auto found = folder_.find(piece_, begun_);
  ASSERT_TRUE(found);
  EXPECT_EQ(samples_to_json(*found), samples_to_json(made_));
  EXPECT_EQ(found->silhouette_faults[0].camera, "cam02");
  EXPECT_EQ(found->quality[1].second.coverage, 0.2);
}

TEST_F(FinishedPiece, is_not_believed_when_it_is_damaged) {
  spoil(folder_.mesh(piece_), 70);
  EXPECT_FALSE(folder_.find(piece_, begun_));
}

TEST_F(FinishedPiece, is_not_believed_when_its_report_is_damaged) {
  const auto path = temporary_ / "piece-000001.json";
  spoil(path, read_file(path).find("12.5"));
  EXPECT_FALSE(folder_.find(piece_, begun_));
  replace_file(path, read_file(path).substr(0, 100));
  EXPECT_FALSE(folder_.find(piece_, begun_));
}

TEST_F(FinishedPiece, is_not_believed_when_it_holds_other_pulses) {
  EXPECT_FALSE(folder_.find({1, {25, 26, 27}}, begun_));
}

TEST_F(FinishedPiece, is_gone_when_it_is_dropped) {
  folder_.drop(piece_);
  EXPECT_TRUE(folder_.saved().empty());
  EXPECT_FALSE(folder_.find(piece_, begun_));
}

TEST_F(FinishedPiece, goes_behind_others_in_the_report_of_the_whole) {
  ReconstructReport whole = begun_;
  append(whole, made_);
  append(whole, made_);
  EXPECT_EQ(whole.frames, 4);
  EXPECT_THAT(whole.volume_m3, ElementsAre(0.1, 1.0 / 3, 0.1, 1.0 / 3));
  EXPECT_THAT(whole.camera_iou[1], ElementsAre(1e-9, 1e-9));
  EXPECT_THAT(whole.stages[1].ms, ElementsAre(12.5, 1.0 / 7, 12.5, 1.0 / 7));
  EXPECT_EQ(whole.silhouette_faults.size(), 2U);
  EXPECT_EQ(whole.peak_rss_mb, 321.5);
}

using LockState = PieceFolderLock::State;

TEST(FolderOfPieces, is_waited_for_by_one_at_a_time) {
  const test::TemporaryFolder temporary;
  const PieceFolder folder(temporary / ".");
  const PieceFolderLock first(folder);
  EXPECT_EQ(first.state(), LockState::kHeld);
  EXPECT_EQ(PieceFolderLock(folder).state(), LockState::kHeldByAnother);
}

TEST(FolderOfPieces, whose_lock_cannot_be_opened_says_so_and_is_not_held) {
  const test::TemporaryFolder temporary;
  std::filesystem::create_directory(temporary / "lock");
  const PieceFolderLock lock(PieceFolder(temporary.path()));
  EXPECT_EQ(lock.state(), LockState::kUnknown);
  EXPECT_EQ(lock.error(), (temporary / "lock").string() + ": Is a directory");
}

class OtherFolderOfPieces : public testing::Test {
 protected:
  OtherFolderOfPieces() {
    for (const PieceFolder& folder : {own_, other_}) {
      std::filesystem::create_directory(folder.path());
      folder.refuse("a file of the run");
    }
  }
  bool other_is_left() {
    own_.remove_others();
    EXPECT_TRUE(own_.refusal());
    return other_.refusal().has_value();
  }

  test::TemporaryFolder take_;
  const PieceFolder own_{take_ / ".pieces-1"}, other_{take_ / ".pieces-2"};
};

TEST_F(OtherFolderOfPieces, is_removed_when_its_lock_is_free) { EXPECT_FALSE(other_is_left()); }

TEST_F(OtherFolderOfPieces, stays_while_another_run_holds_its_lock) {
  const PieceFolderLock running(other_);
  EXPECT_TRUE(other_is_left());
}

TEST_F(OtherFolderOfPieces, stays_when_its_lock_cannot_be_opened) {
  std::filesystem::create_directory(other_.path() / "lock");
  EXPECT_TRUE(other_is_left());
}

}  // namespace
}  // namespace v3d::ctl
