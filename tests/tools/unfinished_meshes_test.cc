// Commands that read a mesh file without an index, because it is truncated or not finished.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <string>
#include <vector>

#include "base/core/error.h"
#include "common/mesh_formats.h"
#include "recon/figures.h"
#include "support/temporary_folder.h"
#include "tools/command_outcome.h"
#include "tools/gliding_take.h"
#include "tools/test_images.h"

namespace v3d::ctl {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;
using testing::Not;

/// A take with the true surfaces of all pulses, and a scene that shows it twice.
class UnfinishedMeshes : public testing::Test {
 protected:
  UnfinishedMeshes() {
    const Mesh person = recon::figures::surface(recon::figures::person(70, 50), 0.05);
    test::write_gliding_take(folder_ / "take");
    test::write_still_meshes(folder_ / "take", person, {});
    fs::create_directory(folder_ / "truth");
    for (int pulse = 0; pulse < test::kGlidingPulses; ++pulse) {
      write_ply(folder_ / "truth" / ("00000" + std::to_string(pulse) + ".ply"), person);
    }
    test::write_text(folder_ / "scene.json", R"({"v3d_scene": 1, "seconds": 1,
        "takes": [{"take": "take"}, {"take": "take", "start_s": 0.1}],
        "camera": {"keys": [{"at_s": 0, "eye": [0, -3, 1], "look": [0, 0, 1]}]}})");
  }

  /// Writes meshes that show a skeleton.
  void write_fine_meshes() {
    test::write_still_meshes(folder_ / "take",
                             recon::figures::surface(recon::figures::person(70, 50), 0.025), {});
  }

  /// Expects one line that reports mesh.v3d after its truncation and none before, and the status
  /// after it. Returns the status before.
  int expect_line(void (*add)(CommandLine&), const std::vector<std::string>& words) {
    const test::CommandOutcome whole = test::run_command(add, words);
    EXPECT_THAT(whole.error, Not(HasSubstr("has no index")));
    const fs::path meshes = folder_ / "take/mesh.v3d";
    test::truncate_file(meshes, 0.6);
    const test::CommandOutcome outcome = test::run_command(add, words);
    EXPECT_EQ(outcome.status, kExitIncomplete) << outcome.error;
    const std::string line = meshes.string() + ": has no index: it is truncated or not finished";
    EXPECT_THAT(outcome.error, HasSubstr(line));
    EXPECT_THAT(outcome.error.substr(outcome.error.find(line) + 1), Not(HasSubstr(line)));
    return whole.status;
  }

  /// The same, and expects that the command is done before the truncation.
  void expect_report(void (*add)(CommandLine&), const std::vector<std::string>& words) {
    EXPECT_EQ(expect_line(add, words), kExitDone);
  }

  const test::TemporaryFolder folder_;
};

TEST_F(UnfinishedMeshes, are_reported_when_a_frame_is_rendered) {
  expect_report(add_render, {"render", folder_ / "take", folder_ / "a.png", "--camera", "a"});
}

TEST_F(UnfinishedMeshes, are_reported_once_when_a_scene_is_rendered) {
  expect_report(add_render, {"render", "--scene", folder_ / "scene.json", "--at", "0.1", "--size",
                             "64x48", folder_ / "a.png"});
}

TEST_F(UnfinishedMeshes, are_reported_when_they_are_evaluated) {
  expect_report(add_evaluate, {"evaluate", folder_ / "take", "--truth", folder_ / "truth"});
}

TEST_F(UnfinishedMeshes, are_reported_when_a_skeleton_is_learnt) {
  write_fine_meshes();
  expect_line(add_skeleton, {"skeleton", folder_ / "take"});
}

TEST_F(UnfinishedMeshes, are_reported_once_when_poses_are_compared) {
  write_fine_meshes();
  expect_report(add_skeleton, {"skeleton", folder_ / "take", "--like", "0"});
}

TEST_F(UnfinishedMeshes, are_reported_once_when_an_action_is_spliced_with_itself) {
  write_fine_meshes();
  test::write_text(folder_ / "turn.json", R"({"format": "v3d-edit", "version": 1, "operations": [
      {"do": "splice", "take": "take", "blend": 1}]})");
  expect_line(add_edit, {"edit", folder_ / "take", folder_ / "turn.json"});
}

}  // namespace
}  // namespace v3d::ctl
