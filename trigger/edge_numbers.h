// Pulse numbers for sensed edges.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <optional>

#include "base/time.h"

namespace v3d {

/// An edge carries no number, and a pulse that the generator left out has no edge: so the number
/// follows from the time since the edge before, in periods. The first edge is pulse 0, as the first
/// frame is. One thread.
class EdgeNumbers {
 public:
  explicit EdgeNumbers(Duration period) : period_(period) {}

  /// Every edge has a higher number than the one before.
  int64_t number(MonotonicInstant edge) {
    if (last_) {
      const double periods = to_seconds(edge - *last_) / to_seconds(period_);
      number_ += std::max<int64_t>(1, std::llround(periods));
    }
    last_ = edge;
    return number_;
  }

 private:
  const Duration period_;
  std::optional<MonotonicInstant> last_;
  int64_t number_ = 0;
};

}  // namespace v3d
