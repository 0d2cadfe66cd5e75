// Load control of the live deformation in v3d-recond: decides how many passes a pulse gets.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

namespace v3d::recond {

/// Decides by the length of the queue of frame sets (LiveQueue), and by no clock:
///   - A pass starts when no set waits. So pulses use the time that remains until the next set, and
///     the next set waits for one pass at most.
///   - A pass is too slow when kSlowWaiting sets wait after it, kSlowPulses times without a faster
///     one in between; or once, when kMaxWaiting sets wait or sets were dropped. The LiveQueue has
///     room for three times as many sets. The next pulses get no such pass. Single delays, which
///     other programs cause, do not count.
///   - After a pause of some pulses, and when no set waits, the pulses get one pass more. The pause
///     is kFirstPause at first. It doubles, up to kLongestPause, when the pass is too slow again,
///     and is kFirstPause again when the pass was kept for kLongestPause pulses. So a PC that is
///     too slow for a pass loses little time with attempts.
///
/// One thread.
class PassLoadControl {
 public:
  static constexpr size_t kSlowWaiting = 2;
  static constexpr int kSlowPulses = 3;
  static constexpr size_t kMaxWaiting = 8;
  static constexpr int64_t kFirstPause = 25;
  static constexpr int64_t kLongestPause = 1600;

  /// `max_passes`: passes with enough time.
  explicit PassLoadControl(int max_passes)
      : max_passes_(max_passes), passes_(max_passes), slow_(static_cast<size_t>(max_passes)) {}

  /// The most passes of the next pulse, while `waiting` sets wait. Call it once for each pulse.
  /// `behind`: LiveQueue::behind(), sets were dropped; then they are 0.
  int begin_pulse(size_t waiting, bool behind) {
    if (++since_change_ == kLongestPause && was_raised_) pause_ = kFirstPause;
    const int ran = std::exchange(ran_, 0);
    const bool is_other_load = std::exchange(is_other_load_, false);
    if (ran > 0 && !is_other_load && is_too_slow(ran, waiting, behind)) {
      if (was_raised_) pause_ = std::min(2 * pause_, kLongestPause);
      change_to(ran - 1);
    } else if (passes_ < max_passes_ && waiting == 0 && !behind && since_change_ >= pause_) {
      change_to(passes_ + 1);
    }
    return behind ? 0 : passes_;
  }

  /// Whether the next pass of the pulse may start, while `waiting` sets wait. Call it before each.
  bool may_run(size_t waiting) {
    if (waiting > 0) return false;
    ++ran_;
    return true;
  }

  /// Sets that wait at the next pulse do not count: something else than the passes took the time.
  void ignore_waiting() { is_other_load_ = true; }

 private:
  /// `ran`: passes of the pulse before, at least 1. No set waited before the last of them.
  bool is_too_slow(int ran, size_t waiting, bool behind) {
    int& slow = slow_[static_cast<size_t>(ran - 1)];
    slow = waiting >= kSlowWaiting ? slow + 1 : 0;
    if (slow < kSlowPulses && waiting < kMaxWaiting && !behind) return false;
    slow = 0;
    return true;
  }
  void change_to(int passes) {
    was_raised_ = passes > passes_;
    passes_ = passes;
    since_change_ = 0;
  }

  const int max_passes_;
  int passes_;               ///< the most for each pulse
  std::vector<int> slow_;    ///< by last pass of a pulse: how many such pulses in a row were slow
  int ran_ = 0;              ///< passes of the current pulse
  bool was_raised_ = false;  ///< passes_, by the last change
  bool is_other_load_ = false;
  int64_t since_change_ = 0;     ///< pulses
  int64_t pause_ = kFirstPause;  ///< pulses
};

}  // namespace v3d::recond
