// Only `v3dctl takes delete` deletes footage: tests of the sources and of the behaviour.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <map>
#include <set>
#include <sstream>

#include "base/io/whole_file.h"
#include "recording.h"
#include "support/begun_take.h"
#include "support/temporary_folder.h"
#include "take/logs/frame_log.h"
#include "take/logs/mesh_file.h"
#include "take/take_removal.h"

namespace v3d {
namespace {

namespace fs = std::filesystem;

/// Sources that may remove or shorten files, and which files. Except for take_removal, none of them
/// is a recorded file.
const std::map<std::string, std::string> kMayRemove = {
    {"take/take_removal.cc", "takes delete, quarantine, working files"},
    {"base/io/file.cc", "its own temporary file, when it cannot replace the file"},
    {"daemon/node/folder_lock.cc", "the lock file of a folder"},
    {"sim/cameras/trigger_cable.cc", "the socket of the simulated trigger cable"},
    {"tools/bench/record_bench.cc", "its own scratch folder"},
    {"tools/v3dctl/setup/doctor_machine.cc", "the file that it tests the disk's speed with"},
    {"tools/v3dctl/reconstruct/take_reconstruction.cc", "its own unfinished mesh file"},
    {"tools/v3dctl/reconstruct/shard_folder.cc", "shards of a reconstruction"},
    {"tools/v3dctl/import/take_builder.cc", "its own unfinished import"},
    {"tools/v3dctl/takes/collect.cc", "its own copies in .collect"},
    {"wire/key_file.cc", "its own unfinished key file"},
};

std::vector<fs::path> sources() {
  std::vector<fs::path> files;
  for (const char* folder : {"base", "calib", "capture", "codec", "daemon", "recon", "sim", "take",
                             "tools", "trigger", "wire"}) {
    for (const auto& entry : fs::recursive_directory_iterator(fs::path(V3D_SOURCE_DIR) / folder)) {
      const fs::path extension = entry.path().extension();
      if (extension == ".cc" || extension == ".h") files.push_back(entry.path());
    }
  }
  return files;
}

/// True when a source calls a function that removes or shortens files. Ignores comments.
bool removes_files(const fs::path& file) {
  std::istringstream lines(read_file(file));
  for (std::string line; std::getline(lines, line);) {
    line.resize(std::min(line.size(), line.find("//")));
    for (const char* call :
         {"unlink(", "unlinkat(", "rmdir(", "remove_all(", "resize_file(", "ftruncate(",
          "ftruncate64(", " ::truncate(", "fs::remove(", "filesystem::remove(", "O_TRUNC"}) {
      if (line.find(call) != std::string::npos) return true;
    }
  }
  return false;
}

TEST(RemovalCalls, are_made_only_by_the_listed_sources) {
  std::set<std::string> found;
  for (const fs::path& file : sources()) {
    if (removes_files(file)) found.insert(fs::relative(file, V3D_SOURCE_DIR).string());
  }
  std::set<std::string> allowed;
  for (const auto& [file, reason] : kMayRemove) allowed.insert(file);
  EXPECT_EQ(found, allowed);
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

TEST_F(TakeRemoval, deletes_the_whole_take) {
  record();
  const auto deleted = delete_take(paths_);
  EXPECT_TRUE(deleted) << deleted.error().message;
  EXPECT_TRUE(fs::is_empty(folder_.path()));
}

}  // namespace
}  // namespace v3d
