#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <future>
#include <thread>
#include <vector>

#include "sim/cameras/device_clock.h"

namespace v3d::sim {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

TEST(TimerQueue, runs_callbacks_in_the_order_of_their_times_and_calls) {
  std::vector<int> done;
  std::promise<void> last;
  TimerQueue timers;
  const MonotonicInstant now = Monotonic::now();
  timers.at(now + milliseconds(40), [&] { last.set_value(); });
  timers.at(now + milliseconds(20), [&] { done.push_back(2); });
  timers.at(now + milliseconds(20), [&] { done.push_back(3); });
  timers.at(now, [&] { done.push_back(1); });
  ASSERT_EQ(last.get_future().wait_for(seconds(30)), std::future_status::ready);
  EXPECT_THAT(done, testing::ElementsAre(1, 2, 3));
}

TEST(TimerQueue, waits_for_the_running_callback_at_the_end_and_runs_no_more) {
  std::promise<void> started;
  bool done = false;
  bool done_after = false;
  TimerQueue timers;
  timers.at(Monotonic::now(), [&] {
    timers.at(Monotonic::now() + std::chrono::hours(1), [&] { done_after = true; });
    started.set_value();
    std::this_thread::yield();
    done = true;
  });
  ASSERT_EQ(started.get_future().wait_for(seconds(30)), std::future_status::ready);
  timers.end();
  EXPECT_TRUE(done);
  timers.at(Monotonic::now(), [&] { done_after = true; });  // a call after the end has no effect
  timers.end();
  EXPECT_FALSE(done_after);
}

}  // namespace
}  // namespace v3d::sim
