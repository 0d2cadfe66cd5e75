// Load shedding of the live picture: decides which pulses are published, once for all cameras of a
// node.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <mutex>

namespace v3d {

/// Recording has priority over the live picture: while frames queue up, pulses are only written. A
/// pulse is published by all cameras of the node or by none, because a frame set that lacks cameras
/// makes a bad mesh. Any thread.
class LiveAdmission {
 public:
  /// `backlog` returns the length of the longest frame queue of all cameras. Pulses whose first
  /// frame is processed while it exceeds `limit` are skipped.
  LiveAdmission(std::function<int64_t()> backlog, int64_t limit)
      : backlog_(std::move(backlog)), limit_(limit) {}

  /// Whether the pulse is published. The first call for a pulse decides.
  bool admits(int64_t pulse);
  /// The number of pulses skipped.
  int64_t skipped() const;

 private:
  /// Decisions that are kept. Camera queues are shorter, so no older pulse is asked for.
  static constexpr size_t kMaxDecisions = 256;

  const std::function<int64_t()> backlog_;
  const int64_t limit_;
  mutable std::mutex mutex_;  ///< guards the members below
  std::map<int64_t, bool> decided_;
  int64_t skipped_ = 0;
};

}  // namespace v3d
