// The part of one reconstruction node in a take that several nodes share: which meshes it makes, in
// which order meshes are written, and which node publishes them. docs/sharding.md.
#pragma once

#include <cstdint>
#include <deque>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "base/config/studio_values.h"
#include "daemon/bus/channel_list.h"
#include "daemon/recond/shard_members.h"
#include "recon/pipeline/frame_set.h"
#include "take/ledger/ledger.h"

namespace v3d::recond {

struct ShardCounts {
  int64_t made = 0;         ///< meshes made here
  int64_t taken_over = 0;   ///< sets processed here that belong to a node that is not available
  int64_t repeated = 0;     ///< sets processed here because their owner's mesh did not arrive
  int64_t duplicates = 0;   ///< meshes received twice
  int64_t released = 0;     ///< sets of other nodes, released because kMaxHeld were held
  int64_t given_up = 0;     ///< pulses that their owner reported as dropped or failed
  int64_t lost = 0;         ///< pulses without a mesh for any other reason
  int64_t implausible = 0;  ///< ignored sets and meshes: their pulse is not in PlausiblePulses
  int64_t alive = 0;        ///< nodes
};

/// The sharding rules of one node, without threads and network.
///
/// Without frame groups, every node assembles all frame sets, processes those that it owns
/// (owner_of()), and holds the others until it has their meshes. When a node ends, the others own
/// its pulses and hold their sets. When a mesh does not arrive, the node that lacks it makes it.
/// Every node orders the meshes of all nodes by pulse. The first available node of the roster
/// publishes them on V3D_MESH, and the others follow its progress. Where nodes disagree about
/// liveness for a moment, a pulse is made twice and the ReorderBuffer drops one mesh.
///
/// With frame groups, a node receives the groups of its own pulses, and those of nodes that are not
/// available. It holds nothing of other nodes then: sets that a node has not finished when it ends,
/// until the others receive its groups, are lost.
///
/// Pure: after advance(), the take_..() functions return what to do. One thread.
class Shard {
 public:
  /// A pulse counts as lost kLossTimeout after it became known, its owner reported it as done, and
  /// a node that it belongs to fell silent, and after kMaxWait when its owner still reports it as
  /// pending.
  static constexpr Duration kLossTimeout = std::chrono::seconds(1);
  static constexpr Duration kMaxWait = std::chrono::seconds(15);
  /// A mesh that its owner reports as made, but that has not arrived, is made again after this.
  static constexpr Duration kRepeatAfter = std::chrono::milliseconds(300);
  /// A node that joins late takes part from a pulse this far ahead. By then all nodes have its
  /// status.
  static constexpr Duration kJoinDelay = std::chrono::milliseconds(600);
  /// Limits of the sets of other nodes that are held.
  static constexpr size_t kMaxHeld = 128;
  static constexpr size_t kMaxHeldBytes = 512 << 20;

  struct Setup {
    std::string take;
    std::vector<std::string> roster;  ///< sorted
    std::string node;                 ///< this node, of the roster
    double rate_hz = 25;
    bool joins_late = false;  ///< the take runs already
    size_t frame_groups = 1;  ///< number of groups (channel_list.h)
    /// The longest time from a pulse until its set is assembled here.
    Duration deadline = std::chrono::milliseconds(200);
    // Tests on a real network set longer ones, because a busy host delays threads.
    Duration liveness_timeout = ShardMembers::kLivenessTimeout;
    Duration loss_timeout = kLossTimeout;
    Duration repeat_after = kRepeatAfter;
  };
  Shard(const Setup& setup, MonotonicInstant now);

  /// Sets the time to `now` and applies the rules. The on_..() functions use the last such time.
  void advance(MonotonicInstant now);
  /// A pulse of the trigger. With frame groups, nothing else names a pulse of another node before
  /// its mesh arrives.
  void on_pulse(int64_t pulse);
  /// A frame set that was assembled here, by ascending pulse.
  void on_set(recon::ReadySet set);
  void on_status(const wire::ShardMessage& status);
  /// A mesh of another node.
  void on_mesh(wire::MeshMessage mesh);
  /// A mesh that this node made of a set from pop_work().
  void on_own_mesh(wire::MeshMessage mesh);
  /// This node dropped a set from pop_work(), or failed to make its mesh.
  void give_up(int64_t pulse);
  /// Call it when processing of a set from pop_work() begins. Returns false when its mesh has
  /// arrived meanwhile: the set needs no processing.
  bool begin(int64_t pulse);
  /// A mesh was published on V3D_MESH.
  void on_published(const wire::MeshMessage& mesh) {
    if (mesh.take == setup_.take) published_ = std::max(published_, mesh.pulse);
  }

  /// Sets to process here.
  std::vector<recon::ReadySet> pop_work() { return std::exchange(work_, {}); }
  /// The meshes of all nodes by ascending pulse, each once.
  std::vector<wire::MeshMessage> pop_ordered() { return std::exchange(ordered_, {}); }
  /// Those of them that this node must publish on V3D_MESH.
  std::vector<wire::MeshMessage> pop_to_publish() { return std::exchange(to_publish_, {}); }
  /// The frame groups that this node must receive.
  const bus::FrameGroupSet& frame_groups() const { return groups_; }
  /// The status for the other nodes, without `sent` and `seq`.
  wire::ShardMessage status() const;

  ShardCounts counts() const;
  /// Pulses of the stream so far that have no mesh.
  std::vector<int64_t> without_mesh() const { return without_mesh_.all(); }
  /// Is every known pulse ordered and published, and no set held or in work?
  bool is_settled() const;

 private:
  struct Held {
    recon::ReadySet set;
    size_t bytes = 0;
    std::optional<Duration> reported_done;  ///< since when its owner reports the mesh as made
  };
  struct Unpublished {
    wire::MeshMessage mesh;
    Duration since{};
  };
  static constexpr size_t kMaxGivenUp = 64;
  static constexpr size_t kMaxUnpublished = 1024;  ///< twice those of a ReorderBuffer

  void join_after(int64_t pulse);
  void update_frame_groups();
  bool may_be_truncated(const recon::ReadySet& set);
  bool accept_pulse(int64_t pulse);
  void record_known(int64_t pulse);
  void record_announced();
  std::optional<Duration> known_since(int64_t pulse) const;
  Duration lost_after(int64_t pulse, Duration known) const;
  void hold(recon::ReadySet set);
  void release(std::map<int64_t, Held>::iterator held);
  void check_held_sets();
  bool should_make(int64_t pulse, Held& held);
  void queue_work(Held& held);
  bool is_given_up(int64_t pulse) const;
  bool is_pending(int64_t pulse) const;
  bool is_lost(int64_t pulse) const;
  void order_meshes();
  void skip(int64_t pulse);
  void publish();
  bool is_omitted(const Unpublished& front, size_t publisher) const;
  bool may_start_publishing(const Unpublished& front) const;

  const Setup setup_;
  const size_t self_;  ///< index of this node in the roster
  ActiveTimeClock clock_;
  Duration now_{};            ///< of clock_
  MonotonicInstant instant_;  ///< of the last advance()
  ShardMembers members_;
  int64_t first_ = -1;                    ///< this node takes part from here on; -1: not yet
  std::optional<ReorderBuffer> reorder_;  ///< once it does
  bus::FrameGroupSet groups_;
  bus::FrameGroupSet new_groups_;  ///< no set of these was assembled yet
  /// More than FrameSetAssembler accepts.
  PlausiblePulses plausible_{20'000};
  int64_t newest_set_ = -1;
  std::map<int64_t, Held> held_;
  size_t held_bytes_ = 0;
  std::set<int64_t> own_pulses_;  ///< handed out by pop_work(), not finished
  std::deque<int64_t> given_up_;
  std::deque<std::pair<int64_t, Duration>> known_;  ///< newest known pulse, and since when
  /// Pulses of the trigger, and since when, until they are ordered or known.
  std::deque<std::pair<int64_t, Duration>> announced_;
  std::vector<recon::ReadySet> work_;
  std::vector<wire::MeshMessage> ordered_;
  std::vector<wire::MeshMessage> to_publish_;
  std::deque<Unpublished> unpublished_;
  bool publishing_ = false;  ///< has published a mesh
  int64_t published_ = -1;   ///< newest pulse on V3D_MESH
  take::PulseSet without_mesh_;
  ShardCounts counts_;
};

}  // namespace v3d::recond
