// Simulated pulse generator, wired to all cameras and to the sense line of its node.
#pragma once

#include <functional>
#include <optional>
#include <utility>

#include "simulation/virtual_time.h"
#include "wire/messages.h"

namespace v3d::simulation {

/// One thread.
class Trigger {
 public:
  using OnTrain = std::function<void(const wire::CommandMessage& order)>;
  using OnEnd = std::function<void()>;
  using OnPulse = std::function<void(int64_t pulse, bool sensed)>;

  Trigger(VirtualTime& time, Draws& draws, OnTrain on_train, OnEnd on_end, OnPulse on_pulse)
      : time_(time),
        draws_(draws),
        on_train_(std::move(on_train)),
        on_end_(std::move(on_end)),
        on_pulse_(std::move(on_pulse)) {}

  /// `unsensed`: share of the pulses that the sense line does not detect.
  void set_unsensed(double unsensed) { unsensed_ = unsensed; }

  void arm(const wire::CommandMessage& order, double rate_hz, std::optional<int64_t> count) {
    stop();
    order_ = order;
    period_ = period_of(rate_hz);
    count_ = count;
    commanded_ = 0;
  }
  void start() {
    is_running_ = true;
    on_train_(order_);
    plan(++train_);
  }
  void stop() {
    if (std::exchange(is_running_, false)) on_end_();
  }

  bool is_running() const { return is_running_; }
  bool is_finished() const { return count_ && commanded_ >= *count_; }
  int64_t commanded() const { return commanded_; }

 private:
  void plan(int64_t train) {
    time_.after(period_, [this, train] {
      if (!is_running_ || train != train_ || is_finished()) return;
      on_pulse_(commanded_++, !draws_.chance(unsensed_));
      plan(train);
    });
  }

  VirtualTime& time_;
  Draws& draws_;
  const OnTrain on_train_;
  const OnEnd on_end_;
  const OnPulse on_pulse_;
  wire::CommandMessage order_;
  Duration period_{};
  std::optional<int64_t> count_;
  double unsensed_ = 0;
  bool is_running_ = false;
  int64_t train_ = 0;  ///< number of the train; events of earlier trains do nothing
  int64_t commanded_ = 0;
};

}  // namespace v3d::simulation
