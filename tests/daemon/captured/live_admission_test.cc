#include "daemon/captured/live_admission.h"

#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <mutex>
#include <optional>
#include <stdexcept>
#include <thread>
#include <vector>

#include "daemon/captured/priority_semaphore.h"

namespace v3d {
namespace {

TEST(LiveAdmission, decides_for_a_pulse_once_whatever_happens_between_its_cameras) {
  int64_t backlog = 0;
  LiveAdmission gate([&] { return backlog; }, 2);
  EXPECT_TRUE(gate.admits(0));
  backlog = 3;
  EXPECT_TRUE(gate.admits(0));
  EXPECT_FALSE(gate.admits(1));
  backlog = 0;
  EXPECT_FALSE(gate.admits(1));
  EXPECT_TRUE(gate.admits(2));
}

TEST(LiveAdmission, counts_a_skipped_pulse_once) {
  LiveAdmission gate([] { return 5; }, 2);
  for (int camera = 0; camera < 15; ++camera) {
    gate.admits(7);
    gate.admits(8);
  }
  EXPECT_EQ(gate.skipped(), 2);
}

TEST(PrioritySemaphore, go_to_the_oldest_pulse_first) {
  PrioritySemaphore places(1);
  std::optional<SemaphoreSlot> first(std::in_place, places, 0);
  std::mutex mutex;
  std::vector<int64_t> order;
  std::vector<std::thread> workers;
  for (const int64_t pulse : {9, 4, 6}) {
    workers.emplace_back([&, pulse] {
      const SemaphoreSlot place(places, pulse);
      const std::lock_guard lock(mutex);
      order.push_back(pulse);
    });
  }
  while (places.waiting() < 3) std::this_thread::yield();
  first.reset();
  for (std::thread& worker : workers) worker.join();
  EXPECT_EQ(order, (std::vector<int64_t>{4, 6, 9}));
}

TEST(PrioritySemaphore, let_no_more_work_at_a_time_than_there_are) {
  PrioritySemaphore places(2);
  std::atomic<int> working = 0;
  std::atomic<int> most = 0;
  std::vector<std::thread> workers;
  for (int i = 0; i < 8; ++i) {
    workers.emplace_back([&] {
      for (int64_t pulse = 0; pulse < 200; ++pulse) {
        const SemaphoreSlot place(places, pulse);
        const int now = ++working;
        for (int seen = most; now > seen && !most.compare_exchange_weak(seen, now);) {
        }
        --working;
      }
    });
  }
  for (std::thread& worker : workers) worker.join();
  EXPECT_LE(most, 2);
  EXPECT_EQ(places.waiting(), 0U);
}

TEST(PrioritySemaphore, are_free_again_after_an_exception) {
  PrioritySemaphore places(1);
  const auto fail = [&] {
    const SemaphoreSlot place(places, 0);
    throw std::runtime_error("a frame that cannot be segmented");
  };
  EXPECT_THROW(fail(), std::runtime_error);
  std::atomic<bool> worked = false;
  std::thread worker([&] {
    const SemaphoreSlot place(places, 1);
    worked = true;
  });
  const auto deadline = std::chrono::steady_clock::now() + std::chrono::seconds(10);
  while (!worked && std::chrono::steady_clock::now() < deadline) std::this_thread::yield();
  ASSERT_TRUE(worked) << "waits for a place that nobody holds";
  worker.join();
}

}  // namespace
}  // namespace v3d
