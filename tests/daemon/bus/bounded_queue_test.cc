#include <gtest/gtest.h>

#include <thread>

#include "daemon/bus/subscription_queue.h"

namespace v3d::bus {
namespace {

MonotonicInstant soon() { return Monotonic::now() + std::chrono::seconds(10); }

TEST(BoundedQueue, returns_elements_in_order) {
  BoundedQueue<int> queue(3);
  for (const int n : {1, 2, 3}) EXPECT_TRUE(queue.push(n));
  for (const int n : {1, 2, 3}) EXPECT_EQ(queue.pop(soon()), n);
  EXPECT_EQ(queue.dropped(), 0);
}

TEST(BoundedQueue, drops_the_oldest_and_counts_it) {
  BoundedQueue<int> queue(2);
  queue.push(1);
  queue.push(2);
  EXPECT_FALSE(queue.push(3));
  EXPECT_EQ(queue.pop(soon()), 2);
  EXPECT_EQ(queue.pop(soon()), 3);
  EXPECT_EQ(queue.dropped(), 1);
}

TEST(BoundedQueue, returns_nothing_when_the_deadline_has_passed) {
  BoundedQueue<int> queue(2);
  EXPECT_EQ(queue.pop(Monotonic::now()), std::nullopt);
}

TEST(BoundedQueue, wakes_a_waiting_thread) {
  BoundedQueue<int> queue(2);
  std::thread pusher([&] { queue.push(7); });
  EXPECT_EQ(queue.pop(soon()), 7);
  pusher.join();
}

}  // namespace
}  // namespace v3d::bus
