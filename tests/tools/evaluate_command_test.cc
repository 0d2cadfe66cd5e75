#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include "base/core/error.h"
#include "base/io/file.h"
#include "common/mesh_formats.h"
#include "recon/figures.h"
#include "support/temporary_folder.h"
#include "tools/command_outcome.h"
#include "tools/gliding_take.h"

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

}  // namespace
}  // namespace v3d::ctl
