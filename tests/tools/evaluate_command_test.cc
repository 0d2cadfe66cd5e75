#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <utility>
#include <vector>

#include "base/core/error.h"
#include "base/io/file.h"
#include "common/mesh_formats.h"
#include "recon/figures.h"
#include "recon/shapes.h"
#include "support/temporary_folder.h"
#include "tools/command_outcome.h"
#include "tools/gliding_take.h"
#include "v3dctl/evaluate/evaluate.h"

namespace v3d::ctl {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;

/// A take whose first pulse has a true surface.
class EvaluateCommand : public testing::Test {
 protected:
  EvaluateCommand() {
    test::write_gliding_take(folder_ / "take");
    fs::create_directory(folder_ / "truth");
    const Mesh person = recon::figures::surface(recon::figures::person(70, 50), 0.05);
    write_ply(folder_ / "truth/000000.ply", person);
  }

  test::CommandOutcome evaluate(const std::vector<std::string>& options) {
    std::vector<std::string> words = {"evaluate", (folder_ / "take").string(), "--truth",
                                      (folder_ / "truth").string()};
    words.insert(words.end(), options.begin(), options.end());
    testing::internal::CaptureStdout();
    const test::CommandOutcome outcome = test::run_command(add_evaluate, words);
    printed_ = testing::internal::GetCapturedStdout();
    return outcome;
  }

  const test::TemporaryFolder folder_;
  std::string printed_;  ///< stdout of evaluate()
};

TEST_F(EvaluateCommand, refuses_a_report_that_would_replace_the_meshes_to_compare_with) {
  const std::string other = folder_ / "other.v3d";
  test::write_gliding_motion(other, 0, 3);
  const std::string bytes = read_file(other);
  const test::CommandOutcome outcome = evaluate({"--beside", other, "--report", other});
  EXPECT_EQ(outcome.status, kExitBadInput);
  EXPECT_THAT(outcome.error, HasSubstr("other.v3d: is the file of --beside; use another"));
  EXPECT_EQ(read_file(other), bytes);
}

TEST_F(EvaluateCommand, refuses_files_that_it_cannot_use_before_the_measurements) {
  const std::string nowhere = folder_ / "nodir/x.html", none = folder_ / "none.v3d";
  const std::string motion = folder_ / "take/motion.v3d";
  for (const auto& [option, file] :
       {std::pair("--report", nowhere), {"--report", motion}, {"--beside", none}}) {
    const test::CommandOutcome outcome = evaluate({option, file});
    EXPECT_EQ(outcome.status, kExitBadInput) << file;
    EXPECT_THAT(outcome.error, HasSubstr(file));
    EXPECT_EQ(printed_, "") << file;
  }
}

TEST_F(EvaluateCommand, refuses_view_dependent_colours_without_a_camera_to_render_for) {
  const test::CommandOutcome outcome = evaluate({"--view-dependent"});
  EXPECT_EQ(outcome.status, kExitBadInput);
  EXPECT_THAT(outcome.error, HasSubstr("--view-dependent: expected --held-out CAM,..."));
  EXPECT_EQ(printed_, "");
}

TEST_F(EvaluateCommand, reports_frames_of_the_compared_meshes_that_have_no_truth) {
  test::write_still_meshes(folder_ / "take", recon::shapes::sphere({0, 0, 0.5F}, 0.2F, 16), {});
  for (int frame = 1; frame < test::kGlidingPulses; ++frame) {
    const std::string name = "truth/00000" + std::to_string(frame) + ".ply";
    fs::copy_file(folder_ / "truth/000000.ply", folder_ / name);
  }
  EXPECT_EQ(evaluate({}).status, kExitDone);
  const std::string longer = folder_ / "longer.v3d";
  test::write_gliding_motion(longer, 0, test::kGlidingPulses + 1);
  const test::CommandOutcome outcome = evaluate({"--beside", longer});
  EXPECT_EQ(outcome.status, kExitIncomplete);
  EXPECT_THAT(outcome.error, HasSubstr("no truth in " + (folder_ / "truth").string() +
                                       " for 1 frame of longer.v3d"));
}

/// The report of a ball at all pulses of a take but the last `empty` ones. The true ball has moved
/// by one metre from `first_moved` on.
TruthReport report_of_still_ball(int empty, int first_moved, int frames) {
  const test::TemporaryFolder folder;
  test::write_gliding_take(folder / "take");
  const Mesh ball = recon::shapes::sphere({0, 0, 0.5F}, 0.2F, 16);
  Mesh moved = ball;
  for (Eigen::Vector3f& vertex : moved.vertices) vertex.x() += 1;
  test::write_still_meshes(folder / "take", ball, {}, empty);
  fs::create_directory(folder / "truth");
  for (int frame = 0; frame < frames; ++frame) {
    write_ply(folder / ("truth/00000" + std::to_string(frame) + ".ply"),
              frame < first_moved ? ball : moved);
  }
  return evaluate_truth({folder / "take"}, folder / "truth");
}

TEST(EvaluateTruth, measures_the_moving_surface_where_most_pulses_stand_still) {
  const TruthReport report = report_of_still_ball(0, 3, 4);
  EXPECT_EQ(report.consecutive, 3);
  EXPECT_EQ(report.still_frames, 2);
  EXPECT_EQ(report.moving_frames, 1);
  EXPECT_GT(report.change.moving_p50_mm, 500);
  EXPECT_LT(report.change.flicker_p90_mm, 0.01);
  EXPECT_EQ(report.change.moving, 0) << "the median of the part";
}

TEST(EvaluateTruth, leaves_out_pulses_without_a_mesh_where_these_have_no_value) {
  const TruthReport report = report_of_still_ball(4, 6, 6);
  EXPECT_EQ(report.frames, 6);
  EXPECT_EQ(report.consecutive, 1);
  EXPECT_GT(report.change.still, 0.99);
  double truth = 0, reconstructed = 0;
  for (const recon::VisibilityFigures& f : report.visibility.seen_by) {
    truth += f.truth;
    reconstructed += f.reconstructed;
  }
  EXPECT_NEAR(truth, 1, 1e-9);
  EXPECT_NEAR(reconstructed, 1, 1e-9);
  EXPECT_NEAR(report.visibility.seen_by[0].truth_within, 1.0 / 3, 0.01);
}

TEST(EvaluateTruth, has_no_value_of_a_surface_that_never_moves) {
  nlohmann::ordered_json json;
  put_truth(json, report_of_still_ball(0, 4, 4));
  EXPECT_TRUE(json["moving_mm"]["p50"].is_null()) << json;
  EXPECT_TRUE(json["moving_mm"]["p90"].is_null()) << json;
  EXPECT_EQ(json["moving_mm"]["moving_part"], 0) << json;
  EXPECT_TRUE(json["flicker_mm"]["p50"].is_number()) << json;
}

}  // namespace
}  // namespace v3d::ctl
