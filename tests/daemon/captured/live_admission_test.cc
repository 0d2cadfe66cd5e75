#include "daemon/captured/live_admission.h"

#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <mutex>
#include <optional>
#include <stdexcept>
#include <thread>
#include <vector>

namespace v3d::captured {
namespace {

TEST(LiveAdmission, decides_once_per_pulse_even_if_the_backlog_changes) {
  int64_t backlog = 0;
  LiveAdmission admission([&] { return backlog; }, 2);
  EXPECT_TRUE(admission.admits(0));
  backlog = 3;
  EXPECT_TRUE(admission.admits(0));
  EXPECT_FALSE(admission.admits(1));
  backlog = 0;
  EXPECT_FALSE(admission.admits(1));
  EXPECT_TRUE(admission.admits(2));
}

TEST(LiveAdmission, counts_a_skipped_pulse_once) {
  LiveAdmission admission([] { return 5; }, 2);
  for (int camera = 0; camera < 15; ++camera) {
    admission.admits(7);
    admission.admits(8);
  }
  EXPECT_EQ(admission.skipped(), 2);
}

TEST(PrioritySemaphore, serves_the_lowest_pulse_first) {
  PrioritySemaphore slots(1);
  std::optional<SemaphoreSlot> first(std::in_place, slots, 0);
  std::mutex mutex;
  std::vector<int64_t> order;
  std::vector<std::thread> workers;
  for (const int64_t pulse : {9, 4, 6}) {
    workers.emplace_back([&, pulse] {
      const SemaphoreSlot slot(slots, pulse);
      const std::lock_guard lock(mutex);
      order.push_back(pulse);
    });
  }
  while (slots.waiting() < 3) std::this_thread::yield();
  first.reset();
  for (std::thread& worker : workers) worker.join();
  EXPECT_EQ(order, (std::vector<int64_t>{4, 6, 9}));
}

TEST(PrioritySemaphore, admits_no_more_threads_than_slots) {
  PrioritySemaphore slots(2);
  std::atomic<int> working = 0;
  std::atomic<int> most = 0;
  std::vector<std::thread> workers;
  for (int i = 0; i < 8; ++i) {
    workers.emplace_back([&] {
      for (int64_t pulse = 0; pulse < 200; ++pulse) {
        const SemaphoreSlot slot(slots, pulse);
        const int now = ++working;
        for (int seen = most; now > seen && !most.compare_exchange_weak(seen, now);) {
        }
        --working;
      }
    });
  }
  for (std::thread& worker : workers) worker.join();
  EXPECT_LE(most, 2);
  EXPECT_EQ(slots.waiting(), 0U);
}

TEST(PrioritySemaphore, releases_its_slot_after_an_exception) {
  PrioritySemaphore slots(1);
  const auto fail = [&] {
    const SemaphoreSlot slot(slots, 0);
    throw std::runtime_error("a frame that cannot be segmented");
  };
  EXPECT_THROW(fail(), std::runtime_error);
  std::atomic<bool> worked = false;
  std::thread worker([&] {
    const SemaphoreSlot slot(slots, 1);
    worked = true;
  });
  const auto deadline = std::chrono::steady_clock::now() + std::chrono::seconds(10);
  while (!worked && std::chrono::steady_clock::now() < deadline) std::this_thread::yield();
  ASSERT_TRUE(worked) << "the slot was not released";
  worker.join();
}

}  // namespace
}  // namespace v3d::captured
