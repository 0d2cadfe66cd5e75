// Tests of what the command v3dctl track rejects before it tracks.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <string>
#include <vector>

#include "common/mesh_formats.h"
#include "recon/shapes.h"
#include "support/temporary_folder.h"
#include "tools/command_outcome.h"
#include "tools/gliding_take.h"
#include "v3dctl/command_line.h"

namespace v3d::ctl {
namespace {

using testing::HasSubstr;
namespace fs = std::filesystem;

/// A take without meshes and a folder with a damaged mesh: a command that opened one of them would
/// report that.
class TrackCommand : public testing::Test {
 protected:
  TrackCommand() {
    test::write_gliding_take(take_);
    fs::create_directory(meshes_);
    test::write_text(meshes_ / "0.obj", "v 0 0 0\n");
  }

  /// The message of `v3dctl track WORDS`, which is rejected.
  std::string rejection(std::vector<std::string> words) {
    words.insert(words.begin(), "track");
    const test::CommandOutcome outcome = test::run_command(add_track, words);
    EXPECT_EQ(outcome.status, kExitBadInput) << outcome.error;
    return outcome.error;
  }

  const test::TemporaryFolder folder_;
  const fs::path take_ = folder_ / "take", meshes_ = folder_ / "meshes";
};

TEST_F(TrackCommand, rejects_a_place_for_the_result_before_it_opens_the_input) {
  const fs::path absent = folder_ / "absent" / "x.v3d";
  const fs::path recorded = take_ / "motion.v3d";
  for (const fs::path& input : {take_, folder_ / "nothing"}) {
    EXPECT_THAT(rejection({input, "--out", absent}),
                HasSubstr("--out " + absent.string() + ": its folder"));
    EXPECT_THAT(rejection({input, "--out", meshes_}), HasSubstr("meshes: is a folder"));
    EXPECT_THAT(rejection({input, "--out", recorded}), HasSubstr("is a recorded file of a take"));
  }
  EXPECT_THAT(rejection({absent, "--meshes", meshes_, "--processes", "1"}),
              HasSubstr("OUT " + absent.string() + ": its folder"));
}

TEST_F(TrackCommand, rejects_a_truth_that_is_no_folder_before_it_opens_the_input) {
  EXPECT_THAT(rejection({take_, "--truth", folder_ / "absent"}),
              HasSubstr("--truth " + (folder_ / "absent").string() + ": is not a folder"));
}

TEST_F(TrackCommand, creates_the_folder_of_its_result_only_for_meshes_that_it_can_track) {
  const fs::path out = folder_ / "new" / "body";
  EXPECT_THAT(rejection({out, "--meshes", folder_ / "absent"}), HasSubstr("is not a folder"));
  EXPECT_THAT(rejection({out, "--meshes", meshes_, "--step", "2m"}), HasSubstr("--step 2m"));
  EXPECT_THAT(rejection({out, "--meshes", meshes_}), HasSubstr("has no face"));
  EXPECT_FALSE(fs::exists(folder_ / "new"));

  fs::remove_all(meshes_);
  fs::create_directory(meshes_);
  write_ply(meshes_ / "0.ply", recon::shapes::sphere({0, 0, 1}, 900, 24));  // millimetres
  EXPECT_THAT(rejection({out, "--meshes", meshes_}), HasSubstr("expected a larger --step"));
  EXPECT_FALSE(fs::exists(folder_ / "new"));

  write_ply(meshes_ / "0.ply", recon::shapes::sphere({0, 0, 1}, 0.5F, 24));
  const test::CommandOutcome outcome = test::run_command(
      add_track, {"track", out, "--meshes", meshes_, "--triangles", "1000", "--threads", "2"});
  EXPECT_EQ(outcome.status, kExitDone) << outcome.error;
  EXPECT_TRUE(fs::exists(out / "motion.v3d"));
}

}  // namespace
}  // namespace v3d::ctl
