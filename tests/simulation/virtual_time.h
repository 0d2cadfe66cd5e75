// Virtual time for simulations: a queue of timed events, run in order without waiting.
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

/// Queue of events. Events of the same instant run in the order in which they were added. One
/// thread.
class VirtualTime {
 public:
  using Action = std::function<void()>;

  MonotonicInstant now() const { return now_; }
  void at(MonotonicInstant time, Action action) {
    events_.push_back({std::max(time, now_), planned_++, std::move(action)});
    std::push_heap(events_.begin(), events_.end());
  }
  void after(Duration delay, Action action) { at(now_ + delay, std::move(action)); }

  /// Runs events until `end`, or until `done`, called after every event, returns true. Returns true
  /// in the latter case.
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

/// Random numbers of one schedule; the same seed gives the same schedule. Bounds are inclusive.
class Draws {
 public:
  explicit Draws(uint64_t seed) : random_(seed) {}

  bool chance(double probability) { return unit() < probability; }
  int integer(int min, int max) { return min + static_cast<int>(unit() * (max - min + 1)); }
  double between(double min, double max) { return min + unit() * (max - min); }
  int64_t nonce() { return static_cast<int64_t>(random_() >> 1) | 1; }
  Duration seconds(double min, double max) { return from_seconds(between(min, max)); }

 private:
  /// From 0 to below 1. std::uniform_real_distribution differs between libraries.
  double unit() { return static_cast<double>(random_() >> 11) * 0x1.0p-53; }

  std::mt19937_64 random_;
};

}  // namespace v3d::simulation
