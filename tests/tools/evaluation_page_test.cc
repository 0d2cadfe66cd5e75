#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/core/error.h"
#include "base/io/file.h"
#include "common/mesh_formats.h"
#include "daemon/recorded/mesh_frames.h"
#include "support/message_of.h"
#include "support/temporary_folder.h"
#include "take/take.h"
#include "tools/command_outcome.h"
#include "tools/gliding_take.h"
#include "tools/imported_ball.h"
#include "v3dctl/evaluate/evaluate.h"
#include "v3dctl/reconstruct/take_reconstruction.h"

namespace v3d::ctl {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::MatchesRegex;
namespace fs = std::filesystem;

/// Meshes of pulses 0 to 5, and others of a part of them.
class EvaluationPages : public testing::Test {
 protected:
  std::string page_beside(int first, int last) {
    const fs::path take = folder_ / "take", other = folder_ / "other.v3d";
    test::write_gliding_take(take);
    test::write_gliding_motion(other, first, last);
    EvaluationPage page;
    page.columns = {{"take", {take}, {}, {}}, {"other", {take, other}, {}, {}}};
    return evaluation_html(page);
  }
  const test::TemporaryFolder folder_;
};

TEST_F(EvaluationPages, show_a_frame_that_all_meshes_have) {
  EXPECT_THAT(page_beside(1, 3), HasSubstr("6 frames, images of frame 2."));
}

TEST_F(EvaluationPages, have_no_images_where_no_frame_is_common) {
  EXPECT_THAT(page_beside(7, 9), HasSubstr("6 frames; no images, because no frame is in all"));
}

int count(const std::string& text, std::string_view word) {
  int found = 0;
  for (size_t at = text.find(word); at != std::string::npos; at = text.find(word, at + 1)) ++found;
  return found;
}

/// Imports a take of a ball in six cameras and reconstructs it without the camera a.
void make_take_without_a(const fs::path& folder, const fs::path& take) {
  test::import_ball(folder, 6, take);
  ReconstructRequest request;
  request.take = take;
  request.bounds = Box{{-0.5, -0.5, -0.5}, {0.5, 0.5, 0.5}};
  request.voxel_m = 0.02;
  request.threads = 2;
  request.leave_out = {"a"};
  reconstruct_take(request);
}

TEST_F(EvaluationPages, show_a_held_out_photograph_beside_vertex_colours_and_atlas) {
  const fs::path take = folder_ / "take";
  make_take_without_a(folder_.path(), take);
  EvaluationPage page;
  page.held_out = {"a"};
  page.atlas_side = 128;
  page.columns = {
      {"take",
       {take},
       {},
       evaluate_held_out({take}, {.cameras = page.held_out, .atlas_side = page.atlas_side})}};
  const std::string html = evaluation_html(page);
  EXPECT_EQ(count(html, "<img"), 5) << "the photograph, two renderings and their differences";
  for (const char* const caption :
       {"photograph", "take: ", "take, atlas: ", "take: difference", "take, atlas: difference"}) {
    EXPECT_THAT(html, HasSubstr(std::string("<figcaption>") + caption));
  }
}

TEST_F(EvaluationPages, have_empty_cells_for_a_camera_without_frames) {
  const fs::path take = folder_ / "take", page = folder_ / "page.html";
  make_take_without_a(folder_.path(), take);
  fs::resize_file(take::TakePaths{take}.frames("a"), 0);
  testing::internal::CaptureStdout();
  const test::CommandOutcome outcome =
      test::run_command(add_evaluate, {"evaluate", take, "--held-out", "a", "--report", page});
  EXPECT_THAT(testing::internal::GetCapturedStdout(),
              MatchesRegex("a +no frame with foreground\n"));
  EXPECT_EQ(outcome.status, kExitIncomplete);
  EXPECT_THAT(outcome.error, HasSubstr("a is missing in 1 frame: see v3dctl verify"));
  const std::string html = read_file(page);
  for (const char* const name : {"a: PSNR, dB", "a: SSIM", "a: silhouette, IoU"}) {
    EXPECT_THAT(html, HasSubstr(std::string("<td>") + name + "</td><td></td>"));
  }
}

TEST_F(EvaluationPages, reject_a_truth_that_is_too_large_or_too_far_for_the_edges_of_the_mesh) {
  const fs::path take = folder_ / "take", truth = folder_ / "truth";
  make_take_without_a(folder_.path(), take);
  fs::create_directory(truth);
  const Mesh mesh = recorded::MeshFrames(take).read(0).mesh;
  const auto rejection = [&](float factor, float moved) {
    Mesh other = mesh;
    for (Eigen::Vector3f& p : other.vertices) p = factor * p + Eigen::Vector3f(moved, 0, 0);
    write_ply(truth / "000000.ply", other);
    return test::message_of<InputError>(
        [&] { evaluate_held_out({take}, {.cameras = {"a"}, .truth = truth}); });
  };
  const auto names_the_file =
      AllOf(HasSubstr("000000.ply: "), HasSubstr("expected metres in the coordinates"));
  EXPECT_THAT(rejection(1000, 0), AllOf(names_the_file, HasSubstr("further triangles")));
  EXPECT_THAT(rejection(1, 500'000), AllOf(names_the_file, HasSubstr("too far from the origin")));
}

}  // namespace
}  // namespace v3d::ctl
