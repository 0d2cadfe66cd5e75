#include "common/console.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <csignal>
#include <cstdlib>

namespace v3d::ctl {
namespace {

TEST(Progress, draws_a_bar_from_empty_to_full) {
  EXPECT_EQ(progress_bar(0, 10, 10), "[>         ]   0 %");
  EXPECT_EQ(progress_bar(5, 10, 10), "[=====>    ]  50 %");
  EXPECT_EQ(progress_bar(10, 10, 10), "[==========] 100 %");
}

TEST(Progress, stays_at_100_percent_for_more_steps_than_the_total) {
  EXPECT_EQ(progress_bar(12, 10, 4), "[====] 100 %");
}

TEST(Progress, prints_a_line_for_every_tenth_when_there_is_no_terminal) {
  testing::internal::CaptureStderr();
  {
    Progress progress("import", 100);
    for (int i = 0; i < 100; ++i) progress.advance();
  }
  const std::string text = testing::internal::GetCapturedStderr();
  EXPECT_EQ(std::count(text.begin(), text.end(), '\n'), 10);
  EXPECT_NE(text.find("import 100 of 100 frames\n"), std::string::npos);
  EXPECT_EQ(text.find('\r'), std::string::npos);
}

TEST(Progress, counts_in_the_unit_of_the_work) {
  testing::internal::CaptureStderr();
  {
    Progress progress("choose cameras", 3, "cameras");
    for (int i = 0; i < 3; ++i) progress.advance();
  }
  const std::string text = testing::internal::GetCapturedStderr();
  EXPECT_NE(text.find("choose cameras 3 of 3 cameras\n"), std::string::npos) << text;
  EXPECT_EQ(text.find("frames"), std::string::npos) << text;
}

TEST(Interrupts, include_the_end_of_the_terminal) {
  EXPECT_EXIT(
      {
        catch_interrupts();
        std::raise(SIGHUP);
        std::exit(interrupted() ? 0 : 1);
      },
      testing::ExitedWithCode(0), "");
}

TEST(Interrupts, exclude_the_end_of_the_terminal_after_nohup) {
  EXPECT_EXIT(
      {
        std::signal(SIGHUP, SIG_IGN);
        catch_interrupts();
        std::raise(SIGHUP);
        std::exit(interrupted() ? 1 : 0);
      },
      testing::ExitedWithCode(0), "");
}

}  // namespace
}  // namespace v3d::ctl
