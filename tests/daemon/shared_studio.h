// A studio whose reconstruction nodes share a take, played on a simulated network: they die, stand
// still, come back, and what they say is lost, late and out of order.
#pragma once

#include <gtest/gtest.h>
#include <rapidcheck.h>

#include <algorithm>
#include <deque>
#include <memory>
#include <queue>
#include <random>
#include <set>
#include <string>
#include <variant>
#include <vector>

#include "daemon/recond/shard.h"
#include "daemon/recond/shard_share.h"

namespace v3d::test {

inline constexpr char kTake[] = "kendo-07";
inline constexpr Duration kStep = std::chrono::milliseconds(10);
inline constexpr Duration kWordEvery = std::chrono::milliseconds(100);

struct Network {
  double loss = 0;         ///< of the messages, for every receiver by itself
  int slowest_ms = 1;      ///< each takes from nothing to so long
  Duration work{};         ///< for one set
  double frames_lost = 0;  ///< sets that a node never had
  size_t groups = 1;       ///< in which frames travel
};

/// Loses messages and no frames, in one group.
inline Network any_network() {
  return {.loss = *rc::gen::inRange(0, 10) * 0.01,
          .slowest_ms = *rc::gen::inRange(1, 60),
          .work = std::chrono::milliseconds(*rc::gen::inRange(0, 40))};
}

/// A studio of some nodes, some time after the take was armed.
class SharedStudio {
 public:
  SharedStudio(size_t nodes, Network network, unsigned seed) : network_(network), random_(seed) {
    for (size_t i = 0; i < nodes; ++i) roster_.push_back("recon" + std::to_string(i + 1));
    for (size_t i = 0; i < nodes; ++i) nodes_.push_back(std::make_unique<Node>(setup(i, false)));
    for (int i = 0; i < 30; ++i) step();
  }

  void kill(size_t node) { nodes_[node].reset(); }
  void start_anew(size_t node) { nodes_[node] = std::make_unique<Node>(setup(node, true)); }
  void hold_still(size_t node, Duration time) { nodes_[node]->still_until = now_ + time; }
  /// What a node drops, as one that cannot keep up.
  void drop(size_t node, int64_t pulse) { nodes_[node]->drops.insert(pulse); }

  /// Pulses at 25 Hz.
  void pulse() {
    const size_t group = FrameNumbers::group_of(pulses_, network_.groups);
    for (auto& node : nodes_) {
      if (!node || !node->shard.frame_groups().contains(group)) continue;
      if (!happens(network_.frames_lost)) node->sets.push_back(pulses_);
    }
    ++pulses_;
    for (int i = 0; i < 4; ++i) step();
  }
  void pulse(int count) {
    for (int i = 0; i < count; ++i) pulse();
  }
  /// Until nothing is outstanding anywhere; false when it does not come to that.
  bool settle() {
    for (int i = 0; i < 6000; ++i) {
      const bool all = std::all_of(nodes_.begin(), nodes_.end(), [](const auto& node) {
        return !node || (node->sets.empty() && node->shard.is_settled());
      });
      if (all) return true;
      step();
    }
    return false;
  }

  int64_t pulses() const { return pulses_; }
  const Shard& shard(size_t node) const { return nodes_[node]->shard; }
  /// What a node has in its file, and what was seen on V3D_MESH.
  const std::vector<int64_t>& file(size_t node) const { return nodes_[node]->file; }
  const std::vector<int64_t>& shown() const { return shown_; }

 private:
  struct Node {
    explicit Node(const Shard::Setup& setup) : shard(setup) {}
    Shard shard;
    std::deque<int64_t> sets;  ///< assembled, not yet told
    std::deque<ReadySet> work;
    MonotonicInstant work_done;
    MonotonicInstant next_word;
    MonotonicInstant still_until;
    std::set<int64_t> drops;
    std::vector<int64_t> file;
  };
  struct Parcel {
    MonotonicInstant due;
    int64_t number;
    size_t to;
    std::variant<ShardMessage, MeshMessage, int64_t> content;  ///< the last: V3D_MESH
    bool operator<(const Parcel& other) const {
      return std::tie(other.due, other.number) < std::tie(due, number);
    }
  };

  Shard::Setup setup(size_t node, bool comes_later) const {
    return {.take = kTake,
            .roster = roster_,
            .me = roster_[node],
            .rate_hz = 25,
            .comes_later = comes_later,
            .frame_groups = network_.groups};
  }
  bool happens(double probability) { return std::bernoulli_distribution(probability)(random_); }
  void send(size_t from, const decltype(Parcel::content)& content) {
    for (size_t to = 0; to < nodes_.size(); ++to) {
      if (to == from || happens(network_.loss)) continue;
      std::uniform_int_distribution<int> delay(0, network_.slowest_ms);
      on_their_way_.push(
          {now_ + std::chrono::milliseconds(delay(random_)), numbered_++, to, content});
    }
  }
  void step() {
    now_ += kStep;
    while (!on_their_way_.empty() && on_their_way_.top().due <= now_) {
      const Parcel parcel = on_their_way_.top();
      on_their_way_.pop();
      if (nodes_[parcel.to]) deliver(nodes_[parcel.to]->shard, parcel);
    }
    for (size_t i = 0; i < nodes_.size(); ++i) {
      if (nodes_[i] && nodes_[i]->still_until <= now_) turn(i, *nodes_[i]);
    }
  }
  static MeshMessage mesh_of(int64_t pulse) {
    MeshMessage mesh;
    mesh.take = kTake;
    mesh.pulse = pulse;
    return mesh;
  }
  static void deliver(Shard& shard, const Parcel& parcel) {
    if (const auto* word = std::get_if<ShardMessage>(&parcel.content)) shard.hear(*word);
    if (const auto* mesh = std::get_if<MeshMessage>(&parcel.content)) shard.hear(*mesh);
    if (const auto* pulse = std::get_if<int64_t>(&parcel.content)) {
      shard.heard_shown(mesh_of(*pulse));
    }
  }
  void turn(size_t i, Node& node) {
    for (; !node.sets.empty(); node.sets.pop_front()) {
      ReadySet set;
      set.set.pulse = node.sets.front();
      node.shard.add(std::move(set));
    }
    work(i, node);
    node.shard.turn(now_);
    for (ReadySet& set : node.shard.take_work()) node.work.push_back(std::move(set));
    for (const MeshMessage& mesh : node.shard.take_ordered()) node.file.push_back(mesh.pulse);
    for (const MeshMessage& mesh : node.shard.take_to_show()) {
      shown_.push_back(mesh.pulse);
      send(i, mesh.pulse);
    }
    if (now_ < node.next_word) return;
    node.next_word = now_ + kWordEvery;
    ShardMessage word = node.shard.word();
    word.sent = from_ns<Realtime>(to_ns(now_));
    send(i, word);
  }
  /// One set after the other.
  void work(size_t i, Node& node) {
    while (!node.work.empty() && node.work_done <= now_) {
      const int64_t pulse = node.work.front().set.pulse;
      node.work.pop_front();
      if (node.drops.contains(pulse)) {
        node.shard.gave_up(pulse);
        continue;
      }
      if (!node.shard.begin(pulse)) continue;
      node.work_done = now_ + network_.work;
      send(i, mesh_of(pulse));
      node.shard.made(mesh_of(pulse));
    }
  }

  const Network network_;
  std::mt19937 random_;
  std::vector<std::string> roster_;
  std::vector<std::unique_ptr<Node>> nodes_;
  std::priority_queue<Parcel> on_their_way_;
  int64_t numbered_ = 0;
  MonotonicInstant now_ = from_ns<Monotonic>(1'000'000'000);
  int64_t pulses_ = 0;
  std::vector<int64_t> shown_;
};

inline std::vector<int64_t> range(int64_t first, int64_t end) {
  std::vector<int64_t> pulses;
  for (int64_t pulse = first; pulse < end; ++pulse) pulses.push_back(pulse);
  return pulses;
}

/// As a viewer sees them, who lets nothing go back.
inline std::vector<int64_t> without_returns(const std::vector<int64_t>& pulses) {
  std::vector<int64_t> seen;
  for (const int64_t pulse : pulses) {
    if (seen.empty() || pulse > seen.back()) seen.push_back(pulse);
  }
  return seen;
}

/// The pulses that a node has in its file or names as those without a mesh, in order.
inline std::vector<int64_t> told(const SharedStudio& studio, size_t node) {
  std::vector<int64_t> all = studio.file(node);
  const auto without = studio.shard(node).without_mesh();
  all.insert(all.end(), without.begin(), without.end());
  std::sort(all.begin(), all.end());
  return all;
}

/// Every pulse is, and the file is in order.
inline void expect_every_pulse_told(const SharedStudio& studio, size_t node, int64_t first) {
  EXPECT_TRUE(std::ranges::is_sorted(studio.file(node)));
  EXPECT_EQ(told(studio, node), range(first, studio.pulses())) << "node " << node;
}

}  // namespace v3d::test
