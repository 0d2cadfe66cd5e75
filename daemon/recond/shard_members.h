// Members of a shared take, order of meshes.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "base/core/time.h"
#include "daemon/bus/channel_list.h"
#include "wire/messages.h"

namespace v3d::recond {

// The reconstruction nodes that share a take: which of them are alive, and which one owns a pulse.

/// Index in the roster of the node that makes the mesh of `pulse` (0 or more).
///
/// `available`: by index, whether the node is alive and takes part at this pulse. At least one is.
/// A node owns the pulses that are its index modulo the size of the roster. Pulses of a node that
/// is not available rotate among the others. So the end of a node moves only its own pulses,
/// evenly, and nodes that agree on `available` agree on the owner.
size_t owner_of(int64_t pulse, const std::vector<bool>& available);

/// The frame groups that carry the pulses owned by the node at `index`, of a roster of `nodes` and
/// of `groups` groups. They carry no other pulses where `nodes` divides `groups`.
bus::FrameGroupSet groups_of(size_t index, size_t nodes, size_t groups);

/// A clock that excludes time in which the process was stopped: it advances by at most kMaxStep
/// between two updates. A process that did not run received nothing meanwhile, so that time must
/// not count as silence of other nodes. One thread.
class ActiveTimeClock {
 public:
  static constexpr Duration kMaxStep = std::chrono::milliseconds(100);

  /// The active time until `now`, which never decreases.
  Duration update(MonotonicInstant now) {
    if (last_) active_ += std::min<Duration>(now - *last_, kMaxStep);
    last_ = now;
    return active_;
  }

 private:
  std::optional<MonotonicInstant> last_;
  Duration active_{};
};

/// The state of each node, from its status messages. A node counts as alive until it was silent for
/// the timeout. Times are of one ActiveTimeClock and never decrease. One thread.
class ShardMembers {
 public:
  static constexpr Duration kLivenessTimeout = std::chrono::milliseconds(400);

  /// `roster` is sorted; `self` is the index of this node in it.
  ShardMembers(std::vector<std::string> roster, size_t self,
               Duration liveness_timeout = kLivenessTimeout);

  /// Status of another node. Returns false, and ignores it, when it is of an unknown node or of
  /// this one, or older than the last one of a node that is alive.
  bool on_status(const wire::ShardMessage& status, Duration now);
  /// This node takes part from `pulse` on.
  void join(int64_t pulse) { members_[self_].status.first = pulse; }
  /// This node makes no mesh of `pulse`, which it owns.
  void give_up(int64_t pulse) { members_[self_].given_up.insert(pulse); }

  size_t size() const { return members_.size(); }
  bool is_alive(size_t index, Duration now) const;
  size_t alive_count(Duration now) const;
  /// Is the node alive, and does it take part at `pulse`?
  bool is_available(size_t index, int64_t pulse, Duration now) const;
  /// The node that makes the mesh of `pulse`; this node where none is available.
  size_t owner(int64_t pulse, Duration now) const;
  /// The node that publishes the mesh of `pulse`: the first available one, else this node.
  size_t publisher(int64_t pulse, Duration now) const;
  /// The number of available nodes between the owner of `pulse` and this node, in roster order.
  int rank(int64_t pulse, Duration now) const;
  /// The last status of another node.
  const wire::ShardMessage& status(size_t index) const { return members_[index].status; }
  /// Since when another node reports `pulse` as done. Empty while it does not. Valid from the
  /// pulse of forget_before() on.
  std::optional<Duration> done_since(size_t index, int64_t pulse) const;
  /// Since when a node that was alive counts as silent. Empty while it is alive, and for a node
  /// without any status.
  std::optional<Duration> silent_since(size_t index, Duration now) const;
  bool has_given_up(size_t index, int64_t pulse) const {
    return members_[index].given_up.contains(pulse);
  }
  /// Frees the state of pulses before `pulse`. has_given_up() and done_since() are no longer valid
  /// for them.
  void forget_before(int64_t pulse);

 private:
  struct Member {
    wire::ShardMessage status;
    std::optional<Duration> received;  ///< when `status` was
    std::set<int64_t> given_up;
    /// Pulses up to the first value are done since the second one. Both increase.
    std::deque<std::pair<int64_t, Duration>> done;
  };
  /// Limits of the state that one node can cause here. Senders list at most 64 pulses.
  static constexpr size_t kMaxGivenUp = 1024;
  static constexpr size_t kMaxDone = 4096;

  std::vector<bool> available_members(int64_t pulse, Duration now) const;

  const std::vector<std::string> roster_;
  const size_t self_;
  const Duration liveness_timeout_;
  std::vector<Member> members_;  ///< by index in the roster
  int64_t forgotten_ = 0;        ///< pulses before this one
};

// Puts the meshes of several nodes into the order of their pulses.

/// A buffer that accepts meshes in any order and returns them by ascending pulse, each pulse once.
///
/// The caller must skip() each pulse that has no mesh, and must skip() when is_full(): add() itself
/// enforces no limit. One thread.
class ReorderBuffer {
 public:
  struct Limits {
    size_t meshes = 512;
    size_t bytes = 128 << 20;
  };
  /// The stream starts with the pulse `first`.
  explicit ReorderBuffer(int64_t first) : ReorderBuffer(first, Limits{}) {}
  ReorderBuffer(int64_t first, Limits limits) : limits_(limits), next_(first) {}

  /// Returns false for a pulse that is buffered already, or before next().
  bool add(wire::MeshMessage mesh);
  /// Removes and returns the mesh of next() and advances to the following pulse. Empty when that
  /// mesh is not buffered.
  std::optional<wire::MeshMessage> pop();
  /// Advances past next(), which must not be buffered.
  void skip() { ++next_; }

  /// The pulse that pop() returns next.
  int64_t next() const { return next_; }
  /// Is the mesh of `pulse` buffered, or is `pulse` before next()?
  bool has(int64_t pulse) const { return pulse < next_ || waiting_.contains(pulse); }
  bool is_full() const { return waiting_.size() >= limits_.meshes || bytes_ >= limits_.bytes; }

 private:
  const Limits limits_;
  int64_t next_;
  std::map<int64_t, wire::MeshMessage> waiting_;
  size_t bytes_ = 0;  ///< of waiting_
};

}  // namespace v3d::recond
