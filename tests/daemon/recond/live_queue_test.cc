#include "daemon/recond/live_queue.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <vector>

namespace v3d::recond {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;

MonotonicInstant at(Duration t) { return MonotonicInstant(seconds(1000) + t); }

constexpr Duration kPeriod = milliseconds(40);

/// Pulses arrive every 40 ms, and a reader works for `work` on each.
struct SimulatedReader {
  LiveQueue<int> queue;
  std::vector<int> taken;
  std::vector<Duration> waited;
  Duration free_at{};
  int pulse = 0;

  void until(Duration end, Duration work) {
    for (; pulse * kPeriod < end; ++pulse) {
      const Duration now = pulse * kPeriod;
      work_until(now, work);
      queue.push(pulse, at(now));
      work_until(now + Duration(1), work);
    }
  }
  void work_until(Duration now, Duration work) {
    while (free_at < now) {
      const auto next = queue.pop(at(free_at));
      if (!next) {
        free_at = now;
        return;
      }
      taken.push_back(*next);
      waited.push_back(free_at - *next * kPeriod);
      free_at += work;
    }
  }
};

TEST(LiveQueue, drops_no_value_in_a_short_pause_of_the_reader) {
  SimulatedReader run;
  run.until(seconds(2), milliseconds(30));
  run.free_at += milliseconds(300);
  run.until(seconds(10), milliseconds(30));
  EXPECT_EQ(run.queue.dropped(), 0);
  EXPECT_FALSE(run.queue.behind(at(seconds(10))));
  for (size_t i = 0; i < run.taken.size(); ++i) ASSERT_EQ(run.taken[i], i);
}

TEST(LiveQueue, drops_no_value_while_the_backlog_of_a_pause_falls_slowly) {
  // The reader works for 39 of 40 ms, so a backlog of eight values takes 13 s.
  SimulatedReader run;
  run.until(seconds(2), milliseconds(39));
  run.free_at += 8 * kPeriod;
  run.until(seconds(10), milliseconds(39));
  EXPECT_GE(run.queue.size(), 1U);
  run.until(seconds(30), milliseconds(39));
  EXPECT_EQ(run.queue.size(), 0U);
  EXPECT_EQ(run.queue.dropped(), 0);
}

TEST(LiveQueue, returns_the_newest_value_to_a_slow_reader_and_spreads_the_drops) {
  SimulatedReader run;
  run.until(seconds(20), milliseconds(60));
  EXPECT_TRUE(run.queue.behind(at(seconds(20))));
  // Of three pulses two are taken; none waits longer than a period, and no two in a row are lost.
  EXPECT_NEAR(static_cast<double>(run.queue.dropped()) / run.pulse, 1.0 / 3, 0.03);
  for (size_t i = run.taken.size() / 2; i < run.taken.size(); ++i) {
    ASSERT_LE(run.waited[i], kPeriod) << i;
    ASSERT_LE(run.taken[i] - run.taken[i - 1], 2) << i;
  }
}

TEST(LiveQueue, is_not_behind_after_the_recovery_time_without_drops) {
  SimulatedReader run;
  run.until(seconds(10), milliseconds(60));
  const int64_t dropped = run.queue.dropped();
  run.until(seconds(19), milliseconds(20));
  EXPECT_TRUE(run.queue.behind(at(seconds(19))));
  run.until(seconds(21), milliseconds(20));
  EXPECT_FALSE(run.queue.behind(at(seconds(21))));
  EXPECT_EQ(run.queue.dropped(), dropped);
}

TEST(LiveQueue, drops_the_oldest_value_beyond_its_limit) {
  LiveQueue<int> queue({.limit = 3});
  for (int i = 0; i < 5; ++i) queue.push(i, at({}));
  EXPECT_EQ(queue.dropped(), 2);
  EXPECT_EQ(queue.pop(at({})), 4) << "behind: the newest";
  EXPECT_EQ(queue.dropped(), 4);
  EXPECT_FALSE(queue.pop(at({})));
}

TEST(LiveQueue, wait_returns_true_when_a_value_is_queued) {
  LiveQueue<int> queue;
  EXPECT_FALSE(queue.wait(Monotonic::now()));
  queue.push(1, Monotonic::now());
  EXPECT_TRUE(queue.wait(Monotonic::now()));
}

TEST(LiveQueue, passes_all_values_to_on_drop_in_drop_all) {
  std::vector<int> dropped;
  LiveQueue<int> queue({.on_drop = [&](int value) { dropped.push_back(value); }});
  for (int n = 0; n < 3; ++n) queue.push(n, at({}));
  queue.drop_all(at({}));
  EXPECT_EQ(dropped, (std::vector<int>{0, 1, 2}));
  EXPECT_EQ(queue.dropped(), 3);
  EXPECT_EQ(queue.size(), 0U);
}

RC_GTEST_PROP(LiveQueue, returns_or_drops_every_pulse_once_and_in_order, ()) {
  LiveQueue<int> queue(
      {.limit = 4, .backlog_timeout = milliseconds(100), .recovery_time = milliseconds(300)});
  Duration now{};
  int pushed = 0, taken = 0, last = -1;
  for (const int step : *rc::gen::container<std::vector<int>>(rc::gen::inRange(0, 60))) {
    now += milliseconds(step);
    if (step % 2 == 0) {
      queue.push(pushed++, at(now));
    } else if (const auto next = queue.pop(at(now))) {
      RC_ASSERT(*next > last);
      last = *next;
      ++taken;
    }
  }
  while (queue.pop(at(now))) ++taken;
  RC_ASSERT(taken + queue.dropped() == pushed);
}

TEST(QueueIdleTimer, depends_on_the_last_check_of_the_reader_not_on_a_clock) {
  QueueIdleTimer idle;
  EXPECT_FALSE(idle.idle_for(Duration::zero())) << "the reader has not checked yet";
  const MonotonicInstant begin = Monotonic::now();
  idle.on_received(begin);
  EXPECT_FALSE(idle.idle_for(Duration::zero())) << "more messages may wait";
  idle.on_empty(begin + milliseconds(20));
  EXPECT_TRUE(idle.idle_for(milliseconds(20)));
  EXPECT_FALSE(idle.idle_for(milliseconds(21))) << "until the reader checks again";
  idle.on_empty(begin + milliseconds(40));
  EXPECT_TRUE(idle.idle_for(milliseconds(21)));
}

TEST(QueueIdleTimer, ends_with_the_next_message) {
  QueueIdleTimer idle;
  const MonotonicInstant begin = Monotonic::now();
  idle.on_empty(begin + milliseconds(500));
  EXPECT_TRUE(idle.idle_for(milliseconds(400)));
  idle.on_received(begin + milliseconds(510));
  EXPECT_FALSE(idle.idle_for(Duration::zero()));
  idle.on_empty(begin + milliseconds(530));
  EXPECT_FALSE(idle.idle_for(milliseconds(400)));
}

}  // namespace
}  // namespace v3d::recond
