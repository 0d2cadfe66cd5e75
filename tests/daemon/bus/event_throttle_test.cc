#include <gtest/gtest.h>

#include "daemon/bus/event_sender.h"

namespace v3d::bus {
namespace {

using namespace std::chrono_literals;

constexpr MonotonicInstant kNow = from_ns<Monotonic>(1'000'000'000);

TEST(EventThrottle, permits_an_event_for_the_first_count_for_a_doubled_one_and_after_a_minute) {
  EventThrottle count;
  std::vector<int64_t> reported;
  for (int64_t n = 1; n <= 50; ++n) {
    if (count.is_report_due(n, kNow + n * 1s)) reported.push_back(n);
  }
  EXPECT_EQ(reported, (std::vector<int64_t>{1, 2, 4, 8, 16, 32}));
  EXPECT_FALSE(count.is_report_due(51, kNow + 91s));
  EXPECT_TRUE(count.is_report_due(51, kNow + 92s)) << "a minute after the last time";
  EXPECT_FALSE(count.is_report_due(51, kNow + 300s)) << "the count has not changed";
}

TEST(EventThrottle, permits_an_event_for_a_count_that_has_halved) {
  EventThrottle count;
  std::vector<int64_t> reported;
  for (int64_t n = 60; n > 0; n -= 10) {
    if (count.is_report_due(n, kNow)) reported.push_back(n);
  }
  EXPECT_EQ(reported, (std::vector<int64_t>{60, 30, 10}));
}

}  // namespace
}  // namespace v3d::bus
