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

/// A reconstruction with one pulse at a time, in virtual time. Times are in periods of the pulses.
class ReconstructionInVirtualTime {
 public:
  /// `cost`: times of a pulse with 0, 1 and 2 passes.
  explicit ReconstructionInVirtualTime(std::vector<double> cost) : cost_(std::move(cost)) {}

  void set_cost(std::vector<double> cost) { cost_ = std::move(cost); }
  /// Something else takes `periods` before the next pulse.
  void delay(double periods) { free_at_ += periods; }

  /// Reconstructs `pulses` pulses and returns the passes of each.
  std::vector<int> run(int64_t pulses) {
    std::vector<int> passes;
    while (std::ssize(passes) < pulses) {
      free_at_ = std::max(free_at_, static_cast<double>(next_));
      const auto waiting = static_cast<size_t>(free_at_) - static_cast<size_t>(next_);
      max_waiting_ = std::max(max_waiting_, waiting);
      passes.push_back(load_.next(waiting, false));
      free_at_ += cost_[static_cast<size_t>(passes.back())];
      ++next_;
    }
    return passes;
  }
  size_t max_waiting() const { return max_waiting_; }
  PassLoadControl& load() { return load_; }

 private:
  PassLoadControl load_{kMaxPasses};
  std::vector<double> cost_;
  double free_at_ = 0;  ///< when the reconstruction can begin with pulse next_
  int64_t next_ = 0;
  size_t max_waiting_ = 0;
};

int64_t changes_of(const std::vector<int>& passes) {
  int64_t changes = 0;
  for (size_t i = 1; i < passes.size(); ++i) changes += passes[i] != passes[i - 1] ? 1 : 0;
  return changes;
}

TEST(PassLoadControl, gives_all_passes_where_there_is_time) {
  ReconstructionInVirtualTime recon({0.3, 0.6, 0.99});
  EXPECT_EQ(recon.run(2000), std::vector<int>(2000, kMaxPasses));
}

TEST(PassLoadControl, drops_no_pulse_when_there_is_time_for_the_hull) {
  for (const double hull : {0.1, 0.5, 0.9}) {
    for (const double pass : {0.06, 0.3, 1.0, 3.0}) {
      ReconstructionInVirtualTime recon({hull, hull + pass, hull + 2 * pass});
      recon.run(20'000);
      EXPECT_LT(recon.max_waiting(), LiveQueue<int>::Options().limit)
          << "hull " << hull << ", pass " << pass;
    }
  }
}

TEST(PassLoadControl, leaves_passes_out_and_changes_seldom_where_time_is_short) {
  ReconstructionInVirtualTime recon({0.5, 0.9, 1.3});
  recon.run(4 * kLongestPause);
  const std::vector<int> passes = recon.run(10 * kLongestPause);
  EXPECT_LE(changes_of(passes), 3 * 10)
      << "one attempt in each longest pause, and then some pulses without passes";
  EXPECT_GT(std::ranges::count(passes, 1), 0.98 * 10 * kLongestPause);
}

TEST(PassLoadControl, gives_all_passes_again_after_a_slow_time) {
  ReconstructionInVirtualTime recon({0.3, 0.6, 0.9});
  recon.run(100);
  recon.set_cost({0.9, 1.2, 1.5});
  recon.run(100);
  recon.set_cost({0.3, 0.6, 0.9});
  recon.run(8 * kFirstPause);
  EXPECT_EQ(recon.run(1000), std::vector<int>(1000, kMaxPasses));
}

TEST(PassLoadControl, leaves_a_pass_out_when_the_queue_does_not_become_shorter) {
  PassLoadControl load(kMaxPasses);
  std::vector<int> passes;
  for (int64_t pulse = 0; pulse <= PassLoadControl::kPatience; ++pulse) {
    passes.push_back(load.next(1, false));
  }
  EXPECT_EQ(passes.front(), kMaxPasses);
  EXPECT_EQ(passes.back(), 0)
      << "LiveQueue drops sets when values wait for too long without a break";
  EXPECT_EQ(load.next(0, false), kMaxPasses - 1);
}

TEST(PassLoadControl, gives_no_pass_to_a_late_picture_until_no_set_waits) {
  ReconstructionInVirtualTime recon({0.3, 0.6, 0.9});
  recon.run(100);
  recon.delay(5);
  std::vector<int> passes = recon.run(20);
  const auto recovered = std::ranges::find_if(passes, [](int n) { return n > 0; });
  EXPECT_LE(recovered - passes.begin(), 8) << "a pulse of 0.3 periods gains 0.7";
  EXPECT_EQ(*recovered, kMaxPasses - 1);
  EXPECT_EQ(recon.run(2 * kFirstPause).back(), kMaxPasses);
}

TEST(PassLoadControl, gives_no_pass_after_sets_were_dropped) {
  PassLoadControl load(kMaxPasses);
  EXPECT_EQ(load.next(0, true), 0);
}

TEST(PassLoadControl, keeps_its_passes_when_something_else_makes_sets_wait) {
  ReconstructionInVirtualTime recon({0.3, 0.6, 0.8});
  recon.run(100);
  recon.delay(9);
  recon.load().ignore_waiting();
  EXPECT_EQ(recon.run(200), std::vector<int>(200, kMaxPasses));
  recon.delay(9);
  EXPECT_LT(recon.run(1).front(), kMaxPasses) << "without ignore_waiting()";
}

}  // namespace
}  // namespace v3d::recond
