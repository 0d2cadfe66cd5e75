// Distributes live meshes to WebSocket clients of different speed.
#pragma once

#include <cstdint>
#include <deque>
#include <memory>
#include <optional>
#include <string>

#include "daemon/web/web_message.h"
#include "wire/messages.h"

namespace v3d {

struct LiveFeedCounts {
  int64_t frames = 0;    ///< meshes received
  int64_t unusable = 0;  ///< of these, dropped: damaged, or the frame they refer to is missing
  int64_t outdated = 0;  ///< of these, dropped: not after the last pulse of the take
  int64_t skipped = 0;   ///< frames not sent to a slow subscriber, summed over subscribers
};

/// Holds the newest key frame and the frames after it. A subscriber that keeps up gets every frame.
/// A slow one gets the next key frame and misses the frames before it. So no client gets a frame
/// without the previous one, and memory is bounded for any number of slow clients. A mesh that is
/// not after the last pulse of its take is dropped: two nodes may publish the same mesh for a
/// moment (daemon/recond/shard.h). One thread.
class LiveFeed {
 public:
  /// Limits of a group, larger than those of the encoder. Beyond them, frames are dropped until the
  /// next key frame.
  static constexpr size_t kMaxFrames = 256;
  static constexpr size_t kMaxBytes = 64 << 20;

  void add(const MeshMessage& mesh);

  /// A subscriber that starts with the newest key frame. The feed must outlive it.
  std::unique_ptr<WebStream> subscribe();

  const LiveFeedCounts& counts() const { return counts_; }

 private:
  class Subscriber;
  struct Frame {
    int64_t number = 0;  ///< index among the frames that were not dropped
    uint32_t checksum = 0;
    std::shared_ptr<const std::string> message;
  };

  void clear_group();
  bool is_outdated(const MeshMessage& mesh) const;
  bool follows(uint32_t reference, int64_t key_pulse) const;

  std::deque<Frame> group_;  ///< the newest key frame and its successors; may be empty
  size_t group_bytes_ = 0;
  int64_t key_pulse_ = -1;  ///< of the group
  std::string take_;        ///< of the last frame, as are pulse_ and sent_
  int64_t pulse_ = -1;
  RealtimeInstant sent_;
  int64_t next_number_ = 0;
  LiveFeedCounts counts_;
};

}  // namespace v3d
