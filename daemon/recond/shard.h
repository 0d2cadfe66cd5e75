// One node's part in a take that several reconstruct.
#pragma once

#include <cstdint>
#include <deque>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "daemon/bus/frame_groups.h"
#include "daemon/recond/active_time_clock.h"
#include "daemon/recond/reorder_buffer.h"
#include "daemon/recond/shard_members.h"
#include "recon/pipeline/frame_set.h"
#include "take/ledger/pulse_set.h"

namespace v3d {

struct ShardCounts {
  int64_t made = 0;        ///< meshes made here
  int64_t taken_over = 0;  ///< sets worked on here that were the share of a node that is not there
  int64_t repeated = 0;    ///< sets worked on here because what their node made did not arrive
  int64_t duplicates = 0;  ///< meshes that were there already
  int64_t let_go = 0;      ///< sets of others that there was no room to hold
  int64_t given_up = 0;    ///< pulses without a mesh by the word of their node: dropped, failed
  int64_t lost = 0;        ///< pulses without a mesh that nobody made
  int64_t living = 0;      ///< nodes
};

/// Every node hears all frames and assembles all sets, works on its share (shard_share.h), and
/// holds the others' sets until it has their meshes. When a node dies, its share falls to the
/// others, who hold its sets; when a mesh did not arrive, whoever misses it makes it again. Every
/// node puts the meshes of all in order; the first of the roster that lives shows them on V3D_MESH,
/// the others listen how far that came. Where nodes disagree for a moment about who lives, a pulse
/// is made twice, and the order drops one; it is never lost.
///
/// Where frames are spread over groups, a node hears those of its share, and of the share of nodes
/// that are not there. It holds nothing of the others then: what a node that dies has not made by
/// the time the others hear its groups is lost.
///
/// Pure: what to do comes out of the take_..() functions after turn(). One thread.
class Shard {
 public:
  /// A pulse that nobody has any more is waited for so long, one that its node still means to make
  /// for kLongest.
  static constexpr Duration kPatience = std::chrono::seconds(1);
  static constexpr Duration kLongest = std::chrono::seconds(15);
  /// What a node says that it made is waited for so long before it is made again.
  static constexpr Duration kOnItsWay = std::chrono::milliseconds(300);
  /// A node that comes later answers from a pulse on that is so far ahead: all have heard by then.
  static constexpr Duration kAhead = std::chrono::milliseconds(600);
  /// Sets of others that are held.
  static constexpr size_t kMaxHeld = 128;
  static constexpr size_t kMaxHeldBytes = 512 << 20;

  struct Setup {
    std::string take;
    std::vector<std::string> roster;  ///< sorted
    std::string me;                   ///< of the roster
    double rate_hz = 25;
    bool comes_later = false;  ///< the take runs already
    size_t frame_groups = 1;   ///< frame_groups.h
  };
  explicit Shard(const Setup& setup);

  /// Time passes. Everything that is told happens at the time of the last turn.
  void turn(MonotonicInstant now);
  /// A set that was assembled here; their pulses rise.
  void add(ReadySet set);
  void hear(const ShardMessage& word);
  /// What another made.
  void hear(MeshMessage mesh);
  /// What this node made of a set from take_work(), or that it made nothing of it.
  void made(MeshMessage mesh);
  void gave_up(int64_t pulse);
  /// A set from take_work() is begun. False when its mesh has come meanwhile: it is done with.
  bool begin(int64_t pulse);
  /// What was heard on V3D_MESH.
  void heard_shown(const MeshMessage& mesh) {
    if (mesh.take == setup_.take) shown_ = std::max(shown_, mesh.pulse);
  }

  /// Sets to work on here.
  std::vector<ReadySet> take_work() { return std::exchange(work_, {}); }
  /// The meshes of all nodes in the order of their pulses, each once.
  std::vector<MeshMessage> take_ordered() { return std::exchange(ordered_, {}); }
  /// Of these, what this node shows on V3D_MESH.
  std::vector<MeshMessage> take_to_show() { return std::exchange(to_show_, {}); }
  /// Whose frames this node has to hear.
  const FrameGroupSet& frame_groups() const { return heard_; }
  /// What to tell the others, but for when and which number.
  ShardMessage word() const;

  ShardCounts counts() const;
  /// Pulses of the stream so far that have no mesh.
  std::vector<int64_t> without_mesh() const { return without_mesh_.all(); }
  /// Nothing that is known of is outstanding, here or elsewhere.
  bool is_settled() const;

 private:
  struct Held {
    ReadySet set;
    size_t bytes = 0;
    std::optional<Duration> promised;  ///< since its node says that it is made
  };
  struct Unshown {
    MeshMessage mesh;
    Duration since{};
  };
  static constexpr size_t kMaxGivenUp = 64;
  static constexpr size_t kMaxUnshown = 512;

  void join_behind(int64_t pulse);
  void choose_frame_groups();
  bool may_be_cut(const ReadySet& set);
  void note_known(int64_t pulse);
  std::optional<Duration> known_since(int64_t pulse) const;
  void hold(ReadySet set);
  void let_go(std::map<int64_t, Held>::iterator held);
  void look_through_held();
  bool is_to_be_made_here(int64_t pulse, Held& held);
  void work_on(Held& held);
  bool is_given_up(int64_t pulse) const;
  bool may_come(int64_t pulse) const;
  bool is_lost(int64_t pulse) const;
  void put_in_order();
  void pass_over(int64_t pulse);
  void show();
  bool may_begin_to_show(const Unshown& first) const;

  const Setup setup_;
  const size_t me_;
  ActiveTimeClock clock_;
  Duration now_{};
  ShardMembers members_;
  int64_t first_ = -1;                  ///< this node answers from here on; -1: not yet
  std::optional<ReorderBuffer> order_;  ///< once it does
  FrameGroupSet heard_;
  FrameGroupSet just_joined_;  ///< of these no set has come yet
  int64_t newest_set_ = -1;
  std::map<int64_t, Held> held_;
  size_t held_bytes_ = 0;
  std::set<int64_t> mine_;  ///< in work, or waiting for it
  std::deque<int64_t> given_up_;
  std::deque<std::pair<int64_t, Duration>> known_;  ///< newest pulse that there is, and since when
  std::vector<ReadySet> work_;
  std::vector<MeshMessage> ordered_;
  std::vector<MeshMessage> to_show_;
  std::deque<Unshown> unshown_;
  bool shows_ = false;  ///< has shown something
  int64_t shown_ = -1;
  PulseSet without_mesh_;
  ShardCounts counts_;
};

}  // namespace v3d
