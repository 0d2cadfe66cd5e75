// Streams for WebSocket clients: meshes, state of the studio.
#pragma once

#include <cstdint>
#include <deque>
#include <map>
#include <memory>
#include <optional>
#include <string>

#include "base/config/studio_file.h"
#include "base/core/time.h"
#include "daemon/viewd/operator_command.h"
#include "daemon/viewd/view_json.h"
#include "daemon/web/web_message.h"
#include "wire/messages.h"

namespace v3d::viewd {

// Distributes live meshes to WebSocket clients of different speed.

struct LiveFeedCounts {
  int64_t frames = 0;    ///< meshes received
  int64_t unusable = 0;  ///< of these, dropped: damaged, or the frame they refer to is missing
  int64_t early = 0;     ///< of these, dropped: before the first key frame, in a take that runs
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
  /// After this time without a mesh, the frames are no live picture: the take has ended, or its
  /// meshes are delayed.
  static constexpr Duration kMaxAge = std::chrono::seconds(5);

  /// `now`: when the mesh was received.
  void add(const wire::MeshMessage& mesh, MonotonicInstant now);

  /// A subscriber that starts with the newest key frame; with the next frame, when the newest one
  /// is older than kMaxAge. The feed must outlive it.
  std::unique_ptr<web::WebStream> subscribe(MonotonicInstant now);

  const LiveFeedCounts& counts() const { return counts_; }

 private:
  class Subscriber;
  struct Frame {
    int64_t number = 0;  ///< index among the frames that were not dropped
    uint32_t checksum = 0;
    std::shared_ptr<const std::string> message;
  };

  void clear_group();
  bool is_outdated(const wire::MeshMessage& mesh) const;
  bool follows(uint32_t reference, int64_t key_pulse) const;

  std::deque<Frame> group_;  ///< the newest key frame and its successors; may be empty
  size_t group_bytes_ = 0;
  MonotonicInstant added_;  ///< when the last frame of the group was received
  int64_t key_pulse_ = -1;  ///< of the group
  std::string take_;        ///< of the last frame, as are pulse_ and sent_
  int64_t pulse_ = -1;
  RealtimeInstant sent_;
  int64_t next_number_ = 0;
  LiveFeedCounts counts_;
};

// The current state of the studio for WebSocket clients: health, previews, events, last command.

/// Holds only the last state, the last preview of each camera, and the last events. So a slow
/// client gets the newest of each, the cameras in turn, and memory is bounded. One thread.
class StudioStatus {
 public:
  static constexpr size_t kEventsKept = 100;
  /// After this time without health a node counts as silent. Nodes send it once a second.
  static constexpr Duration kSilenceTimeout = std::chrono::milliseconds(3500);

  /// The state is sent this often, also without a change: a page notices by this that it arrives.
  static constexpr Duration kStatePeriod = std::chrono::seconds(2);

  /// `nodes`: the nodes to show. `not_verified`: see OperatorClient.
  StudioStatus(const Studio& studio, const std::vector<std::string>& nodes,
               std::string not_verified);

  /// Messages of nodes and cameras that the studio file does not name are ignored.
  void on_health(const wire::HealthMessage& health, MonotonicInstant now);
  void on_event(const wire::EventMessage& event);
  void on_preview(const wire::PreviewMessage& preview);
  void set_not_verified(std::string why);
  void set_subscriber_count(int64_t count);
  void set_control(bool accepts_commands);
  /// The last command; number 0: there was none.
  void set_report(const CommandReport& report);
  /// Removes silent nodes, and publishes the state if it has changed or is kStatePeriod old.
  void refresh(MonotonicInstant now);

  /// A subscriber that starts with the current state. The StudioStatus must outlive it.
  std::unique_ptr<web::WebStream> subscribe() const;

 private:
  class Subscriber;
  struct Item {
    int64_t number = 0;  ///< ascends over all items
    std::shared_ptr<const std::string> text;
  };
  Item make_item(std::string text);

  StudioState state_;
  std::map<std::string, MonotonicInstant> last_health_;  ///< by node
  bool changed_ = true;
  MonotonicInstant published_;  ///< of the state
  int64_t last_number_ = 0;
  Item state_item_;
  Item report_;
  int64_t report_number_ = 0;
  bool report_running_ = false;
  std::deque<Item> events_;
  std::map<std::string, Item> previews_;  ///< by camera
};

}  // namespace v3d::viewd
