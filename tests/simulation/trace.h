// Log of the events of a schedule, to find the cause of a violation.
#pragma once

#include <cstdio>
#include <string>
#include <utility>
#include <vector>

#include "simulation/virtual_time.h"

namespace v3d::simulation {

/// Records lines only when `is_on`: a schedule that fails is run again with it. One thread.
class Trace {
 public:
  Trace(const VirtualTime& time, bool is_on) : time_(time), is_on_(is_on) {}

  bool is_on() const { return is_on_; }
  /// Adds a line with the time. `text` returns the line; it is called only when the trace is on.
  template <class Text>
  void add(const Text& text) {
    if (!is_on_) return;
    char at[32];
    std::snprintf(at, sizeof at, "%9.3f  ", 1e-9 * static_cast<double>(to_ns(time_.now()) % kHour));
    lines_.push_back(at + text());
  }
  const std::vector<std::string>& lines() const { return lines_; }

 private:
  static constexpr int64_t kHour = 3'600'000'000'000;
  const VirtualTime& time_;
  const bool is_on_;
  std::vector<std::string> lines_;
};

}  // namespace v3d::simulation
