// Only `v3dctl takes delete` deletes footage: tests of the behaviour. removal_calls.py tests the
// sources.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <regex>
#include <string>
#include <vector>

#include "base/io/file.h"
#include "base/io/recorded_file.h"
#include "recording.h"
#include "support/begun_take.h"
#include "support/temporary_folder.h"
#include "take/ledger/take_signature.h"
#include "take/logs/frame_log.h"
#include "take/logs/log_files.h"
#include "take/logs/mesh_file.h"
#include "take/logs/repaired_pulses.h"
#include "take/take_listing.h"
#include "take/take_removal.h"

namespace v3d::take {
namespace {

using testing::IsSupersetOf;
namespace fs = std::filesystem;

/// The names in TakePaths, from its source: a file that is added there has to be a recorded file.
std::vector<std::string> names_of_take_paths() {
  const std::string source = read_file(V3D_TAKE_HEADER);
  const std::regex name(R"-(return folder / "([^"]+)";)-");
  std::vector<std::string> names;
  for (std::sregex_iterator found(source.begin(), source.end(), name), end; found != end; ++found) {
    names.push_back((*found)[1]);
  }
  return names;
}

TEST(RecordedFile, is_every_file_that_a_take_has) {
  const test::TemporaryFolder folder;
  const TakePaths paths{folder.path()};
  std::vector<fs::path> files{paths.frames("cam07"),
                              segment_path(paths.frames("cam07"), 1),
                              segment_index_path(paths.frames("cam07")),
                              paths.background() / "cam07.mean.png",
                              paths.sound() / "cap01.wav",
                              paths.earlier_motion(1),
                              signature_path(paths, "cap01"),
                              repaired_pulses_path(paths, "recon01")};
  const std::vector<std::string> names = names_of_take_paths();
  ASSERT_THAT(names,
              IsSupersetOf({"take.toml", "pulses.lcmlog", "sound", "edit.json", ".reserve"}));
  for (const std::string& name : names) {
    if (paths.folder / name != paths.background() && paths.folder / name != paths.sound()) {
      files.push_back(paths.folder / name);
    }
  }
  for (const fs::path& path : files) {
    fs::create_directories(path.parent_path());
    test::write_text(path, "");
  }
  for (const fs::path& path : files) EXPECT_TRUE(is_recorded_file(path)) << path;
  test::write_text(folder / "notes.txt", "");
  EXPECT_FALSE(is_recorded_file(folder / "notes.txt"));
}

class TakeRemoval : public testing::Test {
 protected:
  TakeRemoval() {
    fs::create_directories(paths_.folder);
    EXPECT_TRUE(save_take_info(paths_, test::begun_take({"cam07"})));
  }
  void record() const {
    EventLogWriter frames(paths_.frames("cam07"));
    EXPECT_TRUE(frames.write(test::recorded_frame("cam07", 0, {64, 48})));
  }

  const test::TemporaryFolder folder_;
  const TakePaths paths_{folder_ / "kendo-07"};
};

TEST_F(TakeRemoval, detects_a_frame_in_any_segment) {
  EXPECT_FALSE(may_hold_frames(paths_));
  { const EventLogWriter empty(paths_.frames("cam07")); }
  EXPECT_FALSE(may_hold_frames(paths_));
  {
    EventLogWriter second(paths_.frames("cam07"), LogOpening::kContinue);
    EXPECT_TRUE(second.write(test::recorded_frame("cam07", 0, {64, 48})));
  }
  EXPECT_TRUE(may_hold_frames(paths_));
  EXPECT_TRUE(may_hold_frames({folder_ / "unreadable"}));
}

TEST_F(TakeRemoval, detects_a_frame_of_a_camera_whose_name_begins_like_the_log_of_the_pulses) {
  EventLogWriter pulses(paths_.pulses());
  EXPECT_TRUE(pulses.write(wire::PulseMessage()));
  EXPECT_FALSE(may_hold_frames(paths_));
  EventLogWriter frames(paths_.frames("pulses.left"));
  EXPECT_TRUE(frames.write(test::recorded_frame("pulses.left", 0, {64, 48})));
  EXPECT_TRUE(may_hold_frames(paths_));
}

TEST_F(TakeRemoval, moves_a_whole_take_to_a_free_name_in_quarantine) {
  record();
  const auto first = quarantine_take(paths_);
  ASSERT_TRUE(first) << first.error().message;
  EXPECT_EQ(*first, folder_ / "quarantine/kendo-07");
  EXPECT_EQ(FrameLogReader(TakePaths{*first}.frames("cam07")).labels().size(), 1U);
  fs::create_directories(paths_.folder);
  record();
  EXPECT_EQ(quarantine_take(paths_).value_or(""), folder_ / "quarantine/kendo-07.2");
}

TEST_F(TakeRemoval, keeps_a_mesh_file_with_a_mesh_and_removes_an_empty_one) {
  {
    MeshFileWriter meshes(paths_.mesh());
    EXPECT_TRUE(meshes.append(0, std::vector<uint8_t>{1}));
  }
  remove_mesh_file_without_meshes(paths_);
  EXPECT_TRUE(fs::exists(paths_.mesh()));
  fs::remove(paths_.mesh());
  { const MeshFileWriter empty(paths_.mesh()); }
  remove_mesh_file_without_meshes(paths_);
  EXPECT_FALSE(fs::exists(paths_.mesh()));
  EXPECT_TRUE(fs::exists(paths_.info())) << "a folder with other files remains";
}

TEST_F(TakeRemoval, finishes_interrupted_deletions_which_are_no_takes) {
  record();
  const TakePaths deleted{folder_ / ".deleted-kendo-06"};
  fs::copy(paths_.folder, deleted.folder);
  fs::create_directories(folder_ / ".collect/kendo-05");
  fs::create_directories(folder_ / ".deleted-");
  const auto rests = interrupted_deletions(folder_.path());
  ASSERT_TRUE(rests);
  ASSERT_EQ(rests->size(), 1U);
  EXPECT_EQ(rests->front().take, "kendo-06");
  EXPECT_EQ(rests->front().folder, deleted.folder);
  EXPECT_EQ(list_take_folders(folder_.path()).value(), std::vector<fs::path>{paths_.folder});
  EXPECT_EQ(find_takes(folder_.path(), [](const InputError&) {}).size(), 1U);
  const io::Status finished = finish_deletion(rests->front());
  EXPECT_TRUE(finished) << finished.error().message;
  EXPECT_FALSE(fs::exists(deleted.folder));
  EXPECT_TRUE(fs::exists(paths_.frames("cam07")));
  EXPECT_TRUE(interrupted_deletions(folder_.path())->empty());
  EXPECT_EQ(interrupted_deletions(folder_ / "none").error().message,
            "cannot list folder " + (folder_ / "none").string() + ": No such file or directory");
}

TEST_F(TakeRemoval, deletes_a_take_after_an_interrupted_deletion_of_its_name) {
  record();
  fs::create_directories(folder_ / ".deleted-kendo-07/background");
  const auto deleted = delete_take(paths_);
  EXPECT_TRUE(deleted) << deleted.error().message;
  EXPECT_TRUE(fs::is_empty(folder_.path()));
}

TEST_F(TakeRemoval, deletes_the_whole_take) {
  record();
  const auto deleted = delete_take(paths_);
  EXPECT_TRUE(deleted) << deleted.error().message;
  EXPECT_TRUE(fs::is_empty(folder_.path()));
}

TEST_F(TakeRemoval, rejects_a_take_with_another_take_in_it) {
  record();
  for (const char* folder : {"kendo-08", "background/kendo-08", ".old"}) {
    const fs::path inner = paths_.folder / folder;
    fs::create_directories(inner);
    test::write_text(inner / "cam07.lcmlog", "the only copy");
    const auto deleted = delete_take(paths_);
    ASSERT_FALSE(deleted) << folder;
    EXPECT_EQ(deleted.error().message,
              "cannot delete " + paths_.folder.string() + ": it contains " + folder +
                  "/, which no verification and no copy includes; move it out of the take");
    EXPECT_TRUE(fs::exists(inner / "cam07.lcmlog"));
    fs::remove_all(inner);
  }
}

TEST_F(TakeRemoval, rejects_a_take_with_a_file_whose_name_is_not_utf8) {
  record();
  test::write_text(paths_.folder / "M\xfcller.txt", "note");
  const auto deleted = delete_take(paths_);
  ASSERT_FALSE(deleted);
  EXPECT_EQ(deleted.error().message,
            "cannot delete " + paths_.folder.string() +
                ": it contains M?ller.txt, which no verification and no copy includes; move it out "
                "of the take");
}

TEST_F(TakeRemoval, deletes_the_folders_of_a_take_with_the_links_but_not_their_targets) {
  record();
  for (const char* folder : {"background", "sound", ".shards-0123"}) {
    fs::create_directories(paths_.folder / folder);
  }
  fs::create_directories(folder_ / "elsewhere");
  fs::create_directory_symlink("../elsewhere", paths_.folder / "more");
  const auto deleted = delete_take(paths_);
  EXPECT_TRUE(deleted) << deleted.error().message;
  EXPECT_FALSE(fs::exists(paths_.folder));
  EXPECT_TRUE(fs::exists(folder_ / "elsewhere"));
}

TEST_F(TakeRemoval, rejects_a_link_to_a_take_and_names_the_take) {
  record();
  const TakePaths link{folder_ / "kendo-06"};
  fs::create_directory_symlink("kendo-07", link.folder);
  const auto deleted = delete_take(link);
  ASSERT_FALSE(deleted);
  EXPECT_THAT(deleted.error().message, testing::HasSubstr("kendo-06: it is a symbolic link to " +
                                                          fs::canonical(paths_.folder).string() +
                                                          "; delete the take there"));
  EXPECT_TRUE(fs::is_symlink(link.folder));
}

}  // namespace
}  // namespace v3d::take
