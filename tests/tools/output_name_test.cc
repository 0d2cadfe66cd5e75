// Tests of the names that v3dctl export and render take for files and folders.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "base/core/error.h"
#include "base/geometry/mesh.h"
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

TEST_F(ExportCommand, makes_no_folder_for_colours_of_cameras_without_raw_frames) {
  const std::string out = folder_ / "out";
  const test::CommandOutcome outcome = test::run_command(
      add_export,
      {"export", folder_ / "take", "--format", "ply", "--view-dependent", "--frames", "2", out});
  EXPECT_EQ(outcome.status, kExitBadInput);
  EXPECT_THAT(outcome.error, HasSubstr("raw frames"));
  EXPECT_FALSE(fs::exists(out));
}

/// 400 tetrahedra, each of which has a chart of its own.
Mesh many_pieces() {
  Mesh mesh;
  for (uint32_t piece = 0; piece < 400; ++piece) {
    const auto x = 0.05F * static_cast<float>(piece % 20);
    const auto y = 0.05F * static_cast<float>(piece / 20);
    const uint32_t a = 4 * piece;
    for (const Eigen::Vector3f& corner :
         {Eigen::Vector3f(0, 0, 0), {0.03F, 0, 0}, {0, 0.03F, 0}, {0, 0, 0.03F}}) {
      mesh.vertices.emplace_back(corner + Eigen::Vector3f(x, y, 0));
      mesh.colours.push_back({200, 20, 20});
    }
    mesh.triangles.insert(
        mesh.triangles.end(),
        {{a, a + 2, a + 1}, {a, a + 1, a + 3}, {a, a + 3, a + 2}, {a + 1, a + 2, a + 3}});
  }
  return mesh;
}

TEST_F(ExportCommand, makes_no_folder_where_the_texture_of_the_first_frame_has_no_space) {
  test::write_still_meshes(folder_ / "take", many_pieces(), {});
  const std::string out = folder_ / "out";
  const test::CommandOutcome outcome = test::run_command(
      add_export, {"export", folder_ / "take", "--format", "glb", "--atlas", "64", out});
  EXPECT_EQ(outcome.status, kExitBadInput);
  EXPECT_THAT(outcome.error, HasSubstr("charts do not fit"));
  EXPECT_FALSE(fs::exists(out));
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

TEST(RenderCommand, refuses_a_file_in_a_folder_that_does_not_exist) {
  const test::TemporaryFolder folder;
  const std::string take = folder / "take", scene = folder / "scene.json";
  test::write_gliding_take(take);
  test::write_text(scene, R"({"v3d_scene": 1, "seconds": 0.1, "takes": [{"take": "take"}],
      "camera": {"keys": [{"at_s": 0, "eye": [0, -3, 1], "look": [0, 0, 1]}]}})");
  const std::string picture = folder / "nodir/x.png", video = folder / "nodir/x.mp4";
  for (const std::vector<std::string>& words :
       {std::vector<std::string>{"--scene", scene, "--size", "64x48", "--at", "0", picture},
        {"--scene", scene, "--size", "64x48", video},
        {take, "--camera", "a", picture}}) {
    std::vector<std::string> command = {"render"};
    command.insert(command.end(), words.begin(), words.end());
    const test::CommandOutcome outcome = test::run_command(add_render, command);
    EXPECT_EQ(outcome.status, kExitBadInput) << words.back();
    EXPECT_THAT(outcome.error, HasSubstr("OUT " + words.back() + ": its folder "));
  }
}

}  // namespace
}  // namespace v3d::ctl
