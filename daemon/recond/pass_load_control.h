// Load control of the live deformation in v3d-recond: decides how many passes a pulse gets.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <utility>

namespace v3d::recond {

/// Decides by the length of the queue of frame sets (LiveQueue), and by no clock. A take begins
/// with all passes.
///   - When kGrowth more sets wait than before, or when the queue has not become shorter for
///     kPatience pulses (LiveQueue allows 10 s), the pulses get one pass less from now on. Until
///     the queue is empty they get none, so that the live picture is late for some pulses, not for
///     seconds. Without passes, a pulse costs what the visual hull costs. So no pulse is dropped
///     for a pass.
///   - After a pause of some pulses, and when no set waits, they get one pass more. The pause is
///     kFirstPause at first. It doubles, up to kLongestPause, when the pass has to be given up
///     again, and is kFirstPause again when the pass was kept for kLongestPause pulses. So a PC
///     that is too slow for a pass changes the surface seldom.
///
/// One thread.
class PassLoadControl {
 public:
  static constexpr size_t kGrowth = 2;
  static constexpr int64_t kPatience = 20;
  static constexpr int64_t kFirstPause = 25;
  static constexpr int64_t kLongestPause = 1600;

  /// `max_passes`: passes with enough time.
  explicit PassLoadControl(int max_passes) : max_passes_(max_passes), passes_(max_passes) {}

  /// The passes of the next pulse, while `waiting` sets wait. Call it once for each pulse.
  /// `behind`: LiveQueue::behind(), sets were dropped.
  int next(size_t waiting, bool behind) {
    if (++since_change_ == kLongestPause && was_raised_) pause_ = kFirstPause;
    if (std::exchange(is_other_load_, false) || waiting == 0 || waiting < min_waiting_) {
      min_waiting_ = waiting;
      since_min_ = 0;
    } else {
      ++since_min_;
    }
    const bool is_slow = waiting >= min_waiting_ + kGrowth || since_min_ >= kPatience;
    is_late_ = waiting > 0 && (is_late_ || is_slow);
    if (passes_ > 0 && (behind || is_slow)) {
      if (was_raised_) pause_ = std::min(2 * pause_, kLongestPause);
      change_to(behind ? 0 : passes_ - 1, waiting);
    } else if (passes_ < max_passes_ && waiting == 0 && !behind && since_change_ >= pause_) {
      change_to(passes_ + 1, waiting);
    }
    return is_late_ ? 0 : passes_;
  }

  /// Sets that wait at the next pulse do not count: something else than the passes took the time.
  void ignore_waiting() { is_other_load_ = true; }

 private:
  void change_to(int passes, size_t waiting) {
    was_raised_ = passes > passes_;
    passes_ = passes;
    since_change_ = since_min_ = 0;
    min_waiting_ = waiting;
  }

  const int max_passes_;
  int passes_;
  bool was_raised_ = false;                   ///< by the last change
  int64_t since_change_ = 0, since_min_ = 0;  ///< pulses
  size_t min_waiting_ = 0;                    ///< sets that waited at least, since the last change
  bool is_late_ = false;                      ///< until the queue is empty
  bool is_other_load_ = false;
  int64_t pause_ = kFirstPause;  ///< pulses
};

}  // namespace v3d::recond
