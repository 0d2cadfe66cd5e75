// Which pulses go live: decided once for all cameras of a node.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <mutex>

namespace v3d {

/// The take comes before the live picture: while frames pile up, pulses are only written. A pulse
/// is skipped as a whole or not at all, since a frame set without some cameras makes a bad mesh.
/// Any thread.
class LiveAdmission {
 public:
  /// `backlog`: frames that wait behind the camera which is farthest behind. Pulses that begin
  /// while it is beyond `limit` are skipped.
  LiveAdmission(std::function<int64_t()> backlog, int64_t limit)
      : backlog_(std::move(backlog)), limit_(limit) {}

  /// Whether this pulse goes live. Who asks first decides it for those who come later.
  bool admits(int64_t pulse);
  /// Pulses that were skipped.
  int64_t skipped() const;

 private:
  /// Cameras are never so far apart: their queues are shorter.
  static constexpr size_t kRemembered = 256;

  const std::function<int64_t()> backlog_;
  const int64_t limit_;
  mutable std::mutex mutex_;  ///< what follows
  std::map<int64_t, bool> decided_;
  int64_t skipped_ = 0;
};

}  // namespace v3d
