#include "cli/standard_output.h"

#include <fcntl.h>
#include <gtest/gtest.h>

#include <csignal>
#include <cstdio>
#include <string>

#include "base/core/error.h"
#include "base/io/unique_fd.h"

namespace v3d::cli {
namespace {

/// Replaces standard output of this process.
class ReplacedOutput {
 public:
  explicit ReplacedOutput(int descriptor) : saved_(dup(STDOUT_FILENO)) {
    std::fflush(stdout);
    dup2(descriptor, STDOUT_FILENO);
  }
  ~ReplacedOutput() {
    std::clearerr(stdout);
    dup2(saved_.get(), STDOUT_FILENO);
  }
  ReplacedOutput(const ReplacedOutput&) = delete;
  ReplacedOutput& operator=(const ReplacedOutput&) = delete;

 private:
  io::UniqueFd saved_;
};

struct Outcome {
  int status = 0;
  std::string error;  ///< stderr
};

Outcome finish_after(const std::string& text, int output, int status) {
  const ReplacedOutput replaced(output);
  testing::internal::CaptureStderr();
  std::fputs(text.c_str(), stdout);
  const int finished = finish_standard_output("studio", status);
  return {finished, testing::internal::GetCapturedStderr()};
}

Outcome finish_on_full_disk(const std::string& text, int status) {
  const io::UniqueFd full(::open("/dev/full", O_WRONLY | O_CLOEXEC));
  return finish_after(text, full.get(), status);
}

constexpr char kFull[] = "studio: cannot write standard output: No space left on device\n";

TEST(StandardOutput, that_cannot_be_written_is_a_failure_of_a_program_that_was_done) {
  const Outcome outcome = finish_on_full_disk("kendo-07\n", kExitDone);
  EXPECT_EQ(outcome.status, kExitFailed);
  EXPECT_EQ(outcome.error, kFull);
}

TEST(StandardOutput, that_is_longer_than_its_buffer_has_the_same_message) {
  const Outcome outcome = finish_on_full_disk(std::string(1 << 20, 'x'), kExitDone);
  EXPECT_EQ(outcome.status, kExitFailed);
  EXPECT_EQ(outcome.error, kFull);
}

TEST(StandardOutput, leaves_the_status_of_a_program_that_was_not_done) {
  const Outcome outcome = finish_on_full_disk("kendo-07\n", kExitIncomplete);
  EXPECT_EQ(outcome.status, kExitIncomplete);
  EXPECT_EQ(outcome.error, kFull);
}

TEST(StandardOutput, to_which_nothing_is_written_is_no_failure) {
  const Outcome outcome = finish_on_full_disk("", kExitDone);
  EXPECT_EQ(outcome.status, kExitDone);
  EXPECT_EQ(outcome.error, "");
}

TEST(StandardOutput, whose_reader_has_ended_is_no_failure) {
  int ends[2];
  ASSERT_EQ(pipe2(ends, O_CLOEXEC), 0);
  io::UniqueFd reader(ends[0]);
  const io::UniqueFd writer(ends[1]);
  reader.reset();
  const auto before = std::signal(SIGPIPE, SIG_IGN);
  for (const size_t size : {size_t{1}, size_t{1} << 20}) {
    const Outcome outcome = finish_after(std::string(size, 'x'), writer.get(), kExitDone);
    EXPECT_EQ(outcome.status, kExitDone);
    EXPECT_EQ(outcome.error, "");
  }
  std::signal(SIGPIPE, before);
}

}  // namespace
}  // namespace v3d::cli
