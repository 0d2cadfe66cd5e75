#include "daemon/bus/event_throttle.h"

#include <gtest/gtest.h>

namespace v3d {
namespace {

using namespace std::chrono_literals;

constexpr MonotonicInstant kNow = from_ns<Monotonic>(1'000'000'000);

TEST(EventThrottle, is_news_when_it_begins_when_it_has_doubled_and_after_a_minute) {
  EventThrottle count;
  std::vector<int64_t> told;
  for (int64_t n = 1; n <= 50; ++n) {
    if (count.is_news(n, kNow + n * 1s)) told.push_back(n);
  }
  EXPECT_EQ(told, (std::vector<int64_t>{1, 2, 4, 8, 16, 32}));
  EXPECT_FALSE(count.is_news(51, kNow + 91s));
  EXPECT_TRUE(count.is_news(51, kNow + 92s)) << "a minute after the last time";
  EXPECT_FALSE(count.is_news(51, kNow + 300s)) << "nothing is new";
}

TEST(EventThrottle, counts_down_as_it_counts_up) {
  EventThrottle count;
  std::vector<int64_t> told;
  for (int64_t n = 60; n > 0; n -= 10) {
    if (count.is_news(n, kNow)) told.push_back(n);
  }
  EXPECT_EQ(told, (std::vector<int64_t>{60, 30, 10}));
}

}  // namespace
}  // namespace v3d
