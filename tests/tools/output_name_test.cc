// Tests of the names that v3dctl export and render take for files and folders.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <string>
#include <vector>

#include "base/core/error.h"
#include "support/temporary_folder.h"
#include "tools/command_outcome.h"
#include "tools/gliding_take.h"

namespace v3d::ctl {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;
using testing::Not;

class ExportCommand : public testing::Test {
 protected:
  ExportCommand() { test::write_gliding_take(folder_ / "take"); }

  /// Writes pulse 2 as .ply.
  test::CommandOutcome run_to(const std::string& out) const {
    return test::run_command(add_export, {"export", (folder_ / "take").string(), "--format", "ply",
                                          "--frames", "2", (folder_ / out).string()});
  }

  const test::TemporaryFolder folder_;
};

TEST_F(ExportCommand, makes_no_folder_that_looks_like_a_file_of_another_format) {
  for (const std::string out : {"kendo.obj", "kendo.PLY", "kendo.gltf", "kendo.usda"}) {
    const test::CommandOutcome outcome = run_to(out);
    EXPECT_EQ(outcome.status, kExitBadInput) << out;
    EXPECT_THAT(outcome.error, HasSubstr(out + ": expected a name that ends in .ply, or a folder"));
    EXPECT_FALSE(fs::exists(folder_ / out));
  }
}

TEST_F(ExportCommand, writes_to_a_folder_whose_name_has_a_dot) {
  fs::create_directory(folder_ / "old.obj");
  for (const std::string out : {"kendo.v2", "old.obj"}) {
    EXPECT_THAT(run_to(out).error, Not(HasSubstr("expected")));
    EXPECT_TRUE(fs::is_regular_file(folder_ / (out + "/000002.ply"))) << out;
  }
}

TEST_F(ExportCommand, refuses_the_proxy_for_sound_files) {
  const test::CommandOutcome outcome =
      test::run_command(add_export, {"export", (folder_ / "take").string(), "--format", "flac",
                                     "--proxy", (folder_ / "sound").string()});
  EXPECT_EQ(outcome.status, kExitBadInput);
  EXPECT_THAT(outcome.error, HasSubstr("--proxy: --format flac has no surfaces"));
}

TEST(RenderCommand, takes_an_existing_folder_whose_name_has_a_dot) {
  const test::TemporaryFolder folder;
  const std::string scene = folder / "none.json", out = folder / "frames.v2";
  const auto render = [&] {
    return test::run_command(add_render, {"render", "--scene", scene, out}).error;
  };
  EXPECT_THAT(render(), HasSubstr("frames.v2: expected a folder, or a name that ends in .png"));
  fs::create_directory(out);
  EXPECT_THAT(render(), HasSubstr("none.json"));
}

}  // namespace
}  // namespace v3d::ctl
