#include "support/child_process.h"

#include <gtest/gtest-spi.h>
#include <gtest/gtest.h>

#include "support/temporary_folder.h"

namespace v3d::test {
namespace {

/// Starts a shell that prints `text` and continues, and kills it.
void print_and_be_killed(const std::filesystem::path& log, const std::string& text) {
  const ChildProcess child({"/bin/sh", "-c", "echo '" + text + "'; exec sleep 600"}, log);
  EXPECT_TRUE(becomes_true([&] { return child.output() == text + "\n"; }, within(60)));
}

TEST(ChildProcess, fails_the_test_when_a_killed_process_has_printed_a_report_of_a_sanitizer) {
  const TemporaryFolder folder;
  EXPECT_NONFATAL_FAILURE(
      print_and_be_killed(folder / "log", "WARNING: ThreadSanitizer: data race (pid=1)"),
      "log has a report of a sanitizer:\nWARNING: ThreadSanitizer: data race");
  print_and_be_killed(folder / "other", "SEVERE: the disk is full");
}

TEST(ChildProcess, fails_the_test_when_a_process_that_ended_has_printed_a_report_of_a_sanitizer) {
  const TemporaryFolder folder;
  const auto run = [&] {
    ChildProcess child({"/bin/sh", "-c", "echo ==1==ERROR: AddressSanitizer: heap"},
                       folder / "log");
    EXPECT_EQ(child.wait(within(60)), 0);
  };
  EXPECT_NONFATAL_FAILURE(run(), "AddressSanitizer: heap");
}

}  // namespace
}  // namespace v3d::test
