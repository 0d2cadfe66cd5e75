// Which pulse numbers are plausible: rejects wrong numbers in messages.
#pragma once

#include <cstdint>
#include <optional>

#include "base/config/studio_values.h"
#include "base/core/time.h"

namespace v3d {

/// Compares the number of a pulse with the newest number before and with the time since then.
///
/// One wrong number, accepted as the newest, would make all right numbers after it late. A pulse
/// train has at most kMaxPulseRateHz, so the number of a pulse is at most `max_jump` plus
/// kMaxPulseRateHz times the time since the newest one ahead of it. The part with the time permits
/// messages to be absent for any time; `max_jump` permits them to be delayed.
/// `now` must never decrease. One thread.
class PlausiblePulses {
 public:
  static constexpr int64_t kMaxJump = 15'000;  ///< 15 s at kMaxPulseRateHz

  /// Until add(), every number from 0 on is plausible.
  explicit PlausiblePulses(int64_t max_jump = kMaxJump) : max_jump_(max_jump) {}

  bool contains(int64_t pulse, MonotonicInstant now) const {
    if (pulse < 0) return false;
    if (!newest_ || pulse <= *newest_) return true;
    const double since = to_seconds(now - newest_at_) * kMaxPulseRateHz;
    return pulse - *newest_ <= max_jump_ + static_cast<int64_t>(since);
  }
  /// `pulse`, 0 or more, was accepted. Numbers below the newest one change nothing.
  void add(int64_t pulse, MonotonicInstant now) {
    if (newest_ && pulse <= *newest_) return;
    newest_ = pulse;
    newest_at_ = now;
  }

 private:
  int64_t max_jump_;
  std::optional<int64_t> newest_;
  MonotonicInstant newest_at_;
};

}  // namespace v3d
