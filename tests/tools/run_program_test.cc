// Tests of the messages of v3dctl for a command that throws.
#include <gtest/gtest.h>

#include <stdexcept>

#include "base/core/error.h"
#include "tools/command_outcome.h"

namespace v3d::ctl {
namespace {

constexpr char kTwoLines[] = "refused\ncap01: no \x1b[2Jcamera";

template <class Error>
void add_failing(CommandLine& line) {
  line.on_run(line.add("fail", "", {}), []() -> int { throw Error(kTwoLines); });
}

TEST(FailedCommand, prints_each_line_of_its_message) {
  const test::CommandOutcome outcome = test::run_command(add_failing<std::runtime_error>, {"fail"});
  EXPECT_EQ(outcome.status, kExitFailed);
  EXPECT_EQ(outcome.error, "v3dctl: refused\ncap01: no ?[2Jcamera\n");
}

TEST(FailedCommand, prints_one_line_for_bad_input) {
  const test::CommandOutcome outcome = test::run_command(add_failing<InputError>, {"fail"});
  EXPECT_EQ(outcome.status, kExitBadInput);
  EXPECT_EQ(outcome.error, "v3dctl: refused?cap01: no ?[2Jcamera\n");
}

}  // namespace
}  // namespace v3d::ctl
