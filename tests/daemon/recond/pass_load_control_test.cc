#include "daemon/recond/pass_load_control.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <vector>

#include "daemon/recond/live_queue.h"

namespace v3d::recond {
namespace {

constexpr int kMaxPasses = 2;
constexpr int64_t kFirstPause = PassLoadControl::kFirstPause;
constexpr int64_t kLongestPause = PassLoadControl::kLongestPause;

/// Times of a pulse, in periods of the pulses.
struct Cost {
  double hull = 0, pass = 0, colours = 0;
};

/// A reconstruction with one pulse at a time, in virtual time. Times are in periods of the pulses.
class ReconstructionInVirtualTime {
 public:
  explicit ReconstructionInVirtualTime(Cost cost) : cost_(cost) {}

  void set_cost(Cost cost) { cost_ = cost; }
  /// Something else takes `periods` before the next pulse.
  void delay(double periods) { free_at_ += periods; }

  /// Reconstructs `pulses` pulses and returns the passes of each.
  std::vector<int> run(int64_t pulses) {
    std::vector<int> passes;
    while (std::ssize(passes) < pulses) {
      free_at_ = std::max(free_at_, static_cast<double>(next_));
      max_waiting_ = std::max(max_waiting_, waiting());
      const int limit = load_.begin_pulse(waiting(), false);
      free_at_ += cost_.hull;
      int ran = 0;
      while (ran < limit && load_.may_run(waiting())) {
        free_at_ += cost_.pass;
        ++ran;
      }
      free_at_ += cost_.colours;
      passes.push_back(ran);
      ++next_;
    }
    return passes;
  }
  size_t max_waiting() const { return max_waiting_; }
  PassLoadControl& load() { return load_; }

 private:
  size_t waiting() const { return static_cast<size_t>(free_at_) - static_cast<size_t>(next_); }

  PassLoadControl load_{kMaxPasses};
  Cost cost_;
  double free_at_ = 0;  ///< when the reconstruction can begin with pulse next_
  int64_t next_ = 0;
  size_t max_waiting_ = 0;
};

TEST(PassLoadControl, gives_all_passes_where_there_is_time) {
  ReconstructionInVirtualTime recon({.hull = 0.3, .pass = 0.3, .colours = 0.09});
  EXPECT_EQ(recon.run(2000), std::vector<int>(2000, kMaxPasses));
}

TEST(PassLoadControl, uses_the_time_that_remains_where_it_is_short) {
  ReconstructionInVirtualTime recon({.hull = 0.4, .pass = 0.4, .colours = 0.1});
  const std::vector<int> passes = recon.run(2000);
  EXPECT_EQ(std::ranges::count(passes, 0), 0);
  EXPECT_GT(std::ranges::count(passes, 2), 0.2 * 2000) << "in each pulse, 0.1 periods remain";
  EXPECT_EQ(recon.max_waiting(), 0U);
}

TEST(PassLoadControl, drops_no_pulse_when_there_is_time_for_the_hull) {
  for (const double hull : {0.1, 0.5, 0.8}) {
    for (const double pass : {0.06, 0.3, 1.0, 3.0, 10.0}) {
      ReconstructionInVirtualTime recon({.hull = hull, .pass = pass, .colours = 0.1});
      recon.run(20'000);
      EXPECT_LT(recon.max_waiting(), LiveQueue<int>::Options().limit)
          << "hull " << hull << ", pass " << pass;
    }
  }
}

TEST(PassLoadControl, seldom_tries_a_pass_that_makes_several_sets_wait) {
  ReconstructionInVirtualTime recon({.hull = 0.4, .pass = 4, .colours = 0.1});
  recon.run(4 * kLongestPause);
  const std::vector<int> passes = recon.run(10 * kLongestPause);
  EXPECT_LE(10 * kLongestPause - std::ranges::count(passes, 0), 11 * PassLoadControl::kSlowPulses);
}

TEST(PassLoadControl, gives_all_passes_again_after_a_slow_time) {
  ReconstructionInVirtualTime recon({.hull = 0.2, .pass = 0.3, .colours = 0.1});
  recon.run(100);
  recon.set_cost({.hull = 0.4, .pass = 4, .colours = 0.1});
  EXPECT_EQ(recon.run(100).back(), 0);
  recon.set_cost({.hull = 0.2, .pass = 0.3, .colours = 0.1});
  recon.run(8 * kFirstPause);
  EXPECT_EQ(recon.run(1000), std::vector<int>(1000, kMaxPasses));
}

TEST(PassLoadControl, gives_no_pass_to_a_late_picture_until_no_set_waits) {
  ReconstructionInVirtualTime recon({.hull = 0.2, .pass = 0.3, .colours = 0.1});
  recon.run(100);
  recon.delay(5);
  const std::vector<int> passes = recon.run(20);
  EXPECT_EQ(passes.front(), 0);
  EXPECT_EQ(passes.back(), kMaxPasses) << "one delay does not show that a pass is too slow";
  EXPECT_LE(std::ranges::count(passes, 0), 8) << "a pulse of 0.3 periods gains 0.7";
}

TEST(PassLoadControl, leaves_a_pass_out_after_several_delays_or_a_long_one) {
  PassLoadControl several(kMaxPasses);
  for (int i = 0; i < PassLoadControl::kSlowPulses; ++i) {
    ASSERT_EQ(several.begin_pulse(0, false), kMaxPasses);
    EXPECT_TRUE(several.may_run(0));
    EXPECT_TRUE(several.may_run(0));
    several.begin_pulse(PassLoadControl::kSlowWaiting, false);
  }
  EXPECT_EQ(several.begin_pulse(0, false), kMaxPasses - 1);

  PassLoadControl once(kMaxPasses);
  once.begin_pulse(0, false);
  EXPECT_TRUE(once.may_run(0));
  EXPECT_EQ(once.begin_pulse(PassLoadControl::kMaxWaiting, false), 0)
      << "the first pass was the slow one";
}

TEST(PassLoadControl, gives_no_pass_after_sets_were_dropped) {
  PassLoadControl load(kMaxPasses);
  EXPECT_EQ(load.begin_pulse(0, true), 0);
  EXPECT_EQ(load.begin_pulse(0, false), kMaxPasses) << "no pass had run before";
  EXPECT_TRUE(load.may_run(0));
  EXPECT_EQ(load.begin_pulse(0, true), 0);
  EXPECT_EQ(load.begin_pulse(0, false), 0) << "a pass had run before";
}

TEST(PassLoadControl, keeps_its_passes_when_something_else_makes_sets_wait) {
  ReconstructionInVirtualTime recon({.hull = 0.2, .pass = 0.25, .colours = 0.1});
  recon.run(100);
  recon.delay(9);
  recon.load().ignore_waiting();
  EXPECT_EQ(recon.run(20).back(), kMaxPasses);
  recon.delay(9);
  EXPECT_LT(recon.run(20).back(), kMaxPasses) << "without ignore_waiting()";
}

}  // namespace
}  // namespace v3d::recond
