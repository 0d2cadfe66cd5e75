// Virtual time: a queue of events that happen one after the other, without waiting.
#pragma once

#include <cstdint>
#include <functional>
#include <queue>
#include <random>
#include <tuple>
#include <utility>
#include <vector>

#include "base/core/time.h"

namespace v3d::simulation {

/// One thread. Events of the same instant happen in the order in which they were planned.
class VirtualTime {
 public:
  using Action = std::function<void()>;

  MonotonicInstant now() const { return now_; }
  void at(MonotonicInstant time, Action action) {
    events_.push_back({std::max(time, now_), planned_++, std::move(action)});
    std::push_heap(events_.begin(), events_.end());
  }
  void after(Duration delay, Action action) { at(now_ + delay, std::move(action)); }

  /// Until `end`, or until `done` (asked after every event) is true. True in the latter case.
  bool run_until(MonotonicInstant end, const std::function<bool()>& done) {
    while (!events_.empty() && events_.front().time <= end) {
      std::pop_heap(events_.begin(), events_.end());
      const Event event = std::move(events_.back());
      events_.pop_back();
      now_ = event.time;
      event.action();
      if (done()) return true;
    }
    now_ = end;
    return done();
  }

 private:
  struct Event {
    MonotonicInstant time;
    int64_t number = 0;
    Action action;
    bool operator<(const Event& other) const {
      return std::tie(other.time, other.number) < std::tie(time, number);
    }
  };
  MonotonicInstant now_ = from_ns<Monotonic>(3'600'000'000'000);
  std::vector<Event> events_;  ///< a heap
  int64_t planned_ = 0;
};

/// The draws of one schedule: the same seed gives the same schedule.
class Draws {
 public:
  explicit Draws(uint64_t seed) : random_(seed) {}

  bool chance(double probability) { return part() < probability; }
  int integer(int least, int most) { return least + static_cast<int>(part() * (most - least + 1)); }
  double between(double least, double most) { return least + part() * (most - least); }
  int64_t nonce() { return static_cast<int64_t>(random_() >> 1) | 1; }
  Duration seconds(double least, double most) { return from_seconds(between(least, most)); }

 private:
  /// From 0 to below 1; not by std::uniform_real_distribution, which differs between libraries.
  double part() { return static_cast<double>(random_() >> 11) * 0x1.0p-53; }

  std::mt19937_64 random_;
};

}  // namespace v3d::simulation
