// Load control of the silhouette repair in v3d-recond: decides which pulses are repaired.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>

namespace v3d::recond {

/// Decides by the length of the queue of frame sets (LiveQueue), and by no clock:
///   - A repair starts when no set waits behind the pulse.
///   - It is stopped when kMaxWaiting sets wait. The pulse then keeps its silhouettes. There is
///     room for three times as many sets.
///   - After a stopped repair, the next kFirstPause pulses are not repaired. Each further stop
///     doubles the pause, up to kLongestPause. A repair that is not stopped sets it back to
///     kFirstPause.
///     So a PC that is too slow for the repair loses little time with attempts.
///
/// One thread.
class RepairLoadControl {
 public:
  static constexpr size_t kMaxWaiting = 8;
  static constexpr int64_t kFirstPause = 25;
  static constexpr int64_t kLongestPause = 1600;

  /// May the repair of the next pulse start, while `waiting` sets wait? Call it once for each
  /// pulse.
  bool may_start(size_t waiting) {
    if (pause_ > 0) {
      --pause_;
      return false;
    }
    return waiting == 0;
  }
  static bool must_stop(size_t waiting) { return waiting >= kMaxWaiting; }

  void on_finished() { next_pause_ = kFirstPause; }
  void on_stopped() {
    pause_ = next_pause_;
    next_pause_ = std::min(2 * next_pause_, kLongestPause);
  }

 private:
  int64_t pause_ = 0;  ///< pulses
  int64_t next_pause_ = kFirstPause;
};

}  // namespace v3d::recond
