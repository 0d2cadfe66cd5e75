// Live meshes for all who watch, each at the speed of his own line.
#pragma once

#include <cstdint>
#include <deque>
#include <memory>
#include <optional>
#include <string>

#include "daemon/viewd/web_message.h"
#include "wire/messages.h"

namespace v3d {

struct LiveFeedCounts {
  int64_t frames = 0;    ///< meshes that came
  int64_t unusable = 0;  ///< of these, not passed on: damaged, or made for a frame that never came
  int64_t returned = 0;  ///< of these, not passed on: not behind the last of its take
  int64_t skipped =
      0;  ///< frames that were not sent to somebody who was slow; each counts once for each
};

/// Meshes of a take come in order; one that is not behind the last (two nodes that show the same
/// for a moment, daemon/recond/shard.h) goes no further.
/// Holds the newest key frame and what came since, and nothing else. Who can follow gets every
/// frame; who cannot is sent the newest key frame next, as soon as there is one that he has not
/// had, and misses what lies between. So nobody gets a frame that he lacks the frame before of, and
/// nothing accumulates, however many are slow. One thread.
class LiveFeed {
 public:
  /// A group of more frames, or bytes, than any of our encoders makes is not waited for: the next
  /// key frame is.
  static constexpr size_t kMaxFrames = 256;
  static constexpr size_t kMaxBytes = 64 << 20;

  void add(const MeshMessage& mesh);

  /// One who watches, from the newest key frame on. The feed outlives it.
  std::unique_ptr<WebStream> watch();

  const LiveFeedCounts& counts() const { return counts_; }

 private:
  class Watcher;
  struct Frame {
    int64_t number = 0;  ///< counts the frames that were passed on
    uint32_t checksum = 0;
    std::shared_ptr<const std::string> message;
  };

  void begin_group();
  bool goes_back(const MeshMessage& mesh) const;
  bool follows(uint32_t reference, int64_t key_pulse) const;

  std::deque<Frame> group_;  ///< the newest key frame and those after it; may be empty
  size_t group_bytes_ = 0;
  int64_t key_pulse_ = -1;  ///< of the group
  std::string take_;        ///< of the last frame, its pulse, and when it was sent
  int64_t pulse_ = -1;
  RealtimeInstant sent_;
  int64_t numbers_ = 0;
  LiveFeedCounts counts_;
};

}  // namespace v3d
