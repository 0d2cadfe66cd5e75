#include "sim/cameras/timer_queue.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <future>
#include <thread>
#include <vector>

namespace v3d::sim {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

TEST(TimerQueue, does_things_in_the_order_of_their_times_and_of_their_asking) {
  std::vector<int> done;
  std::promise<void> last;
  TimerQueue later;
  const MonotonicInstant now = Monotonic::now();
  later.at(now + milliseconds(40), [&] { last.set_value(); });
  later.at(now + milliseconds(20), [&] { done.push_back(2); });
  later.at(now + milliseconds(20), [&] { done.push_back(3); });
  later.at(now, [&] { done.push_back(1); });
  ASSERT_EQ(last.get_future().wait_for(seconds(30)), std::future_status::ready);
  EXPECT_THAT(done, testing::ElementsAre(1, 2, 3));
}

TEST(TimerQueue, waits_at_its_end_for_what_is_being_done_and_does_nothing_more) {
  std::promise<void> begun;
  bool done = false;
  bool done_after = false;
  TimerQueue later;
  later.at(Monotonic::now(), [&] {
    later.at(Monotonic::now() + std::chrono::hours(1), [&] { done_after = true; });
    begun.set_value();
    std::this_thread::yield();
    done = true;
  });
  ASSERT_EQ(begun.get_future().wait_for(seconds(30)), std::future_status::ready);
  later.end();
  EXPECT_TRUE(done);
  later.at(Monotonic::now(), [&] { done_after = true; });  // by who has not ended yet
  later.end();
  EXPECT_FALSE(done_after);
}

}  // namespace
}  // namespace v3d::sim
