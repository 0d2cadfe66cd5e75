#include "daemon/viewd/request_error_log.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>
#include <string>
#include <vector>

#include "base/core/error.h"
#include "daemon/viewd/take_pictures.h"

namespace v3d::viewd {
namespace {

using namespace std::chrono_literals;
using testing::ElementsAre;

constexpr MonotonicInstant kStart(1h);
const std::string kDamaged = "/takes/kendo-07/cam01.lcmlog: is damaged";

/// The lines for an error in each second from `first` to before `end`.
std::vector<std::string> lines_of(RequestErrorLog& log, int first, int end) {
  std::vector<std::string> lines;
  for (int second = first; second < end; ++second) {
    if (auto line = log.line(kDamaged, kStart + second * 1s)) lines.push_back(*line);
  }
  return lines;
}

TEST(RequestErrorLog, has_a_line_for_the_first_error_for_doubled_ones_and_then_one_a_minute) {
  RequestErrorLog log;
  const auto after = [](const std::string& number) {
    return kDamaged + " (errors of this file that were not logged: " + number + ")";
  };
  EXPECT_THAT(lines_of(log, 0, 16),
              ElementsAre(kDamaged, kDamaged, after("1"), after("3"), after("7")));
  EXPECT_LT(lines_of(log, 16, 3600).size(), 70U) << "an hour";
}

TEST(RequestErrorLog, counts_the_errors_of_each_file_by_its_path) {
  RequestErrorLog log;
  lines_of(log, 0, 3);
  const std::string other = "/takes/kendo-07/cam02.lcmlog: is damaged";
  EXPECT_EQ(log.line(other, kStart + 3s), other);
  const std::string again = "/takes/kendo-07/cam01.lcmlog: another pulse is damaged";
  EXPECT_EQ(log.line(again, kStart + 3s), again + " (errors of this file that were not logged: 1)");
  EXPECT_EQ(log.line(again, kStart + 3s), std::nullopt);
}

TEST(RequestErrorLog, limits_the_lines_of_any_number_of_files) {
  RequestErrorLog log;
  size_t lines = 0;
  for (int n = 0; n < 10'000; ++n) {
    lines += log.line("/takes/" + std::to_string(n) + ": is damaged", kStart).has_value() ? 1 : 0;
  }
  EXPECT_LT(lines, RequestErrorLog::kMaxFiles + 20);
  const std::string later = "/takes/later: is damaged";
  EXPECT_EQ(log.line(later, kStart + 1min), later) << "the first files are forgotten";
}

TEST(RequestErrorLog, limits_the_lines_of_a_request_that_fails_again_and_again) {
  constexpr int kRequests = 200;
  const std::string text = "/takes/repeated-request/cam01.lcmlog: is damaged";
  const auto make = [&]() -> web::WebResponse { throw InputError(text); };
  testing::internal::CaptureStdout();
  for (int request = 0; request < kRequests; ++request) {
    EXPECT_EQ(guarded_response(make).status, 500);
  }
  const std::string log = testing::internal::GetCapturedStdout();
  size_t lines = 0;
  for (size_t at = log.find(text); at != std::string::npos; at = log.find(text, at + 1)) ++lines;
  EXPECT_GE(lines, 1U);
  EXPECT_LT(lines, kRequests / 4U);
}

}  // namespace
}  // namespace v3d::viewd
