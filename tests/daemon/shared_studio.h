// Simulation of reconstruction nodes that share a take. Nodes can be killed, paused and restarted.
// The network loses, delays and reorders messages.
#pragma once

#include <gtest/gtest.h>
#include <rapidcheck.h>

#include <algorithm>
#include <deque>
#include <map>
#include <memory>
#include <queue>
#include <random>
#include <set>
#include <string>
#include <variant>
#include <vector>

#include "daemon/recond/shard.h"

namespace v3d::test {

inline constexpr char kTake[] = "kendo-07";
inline constexpr Duration kStep = std::chrono::milliseconds(10);
inline constexpr Duration kStatusPeriod = std::chrono::milliseconds(100);

struct Network {
  double loss = 0;         ///< probability of losing a message, for each receiver
  int max_delay_ms = 1;    ///< delays are uniform from 0 to this
  Duration work{};         ///< processing time of one set
  double frames_lost = 0;  ///< probability that a node does not receive a set
  size_t groups = 1;       ///< frame groups
};

/// Loses messages but no frames; one frame group.
inline Network any_network() {
  return {.loss = *rc::gen::inRange(0, 10) * 0.01,
          .max_delay_ms = *rc::gen::inRange(1, 60),
          .work = std::chrono::milliseconds(*rc::gen::inRange(0, 40))};
}

/// A studio of `nodes` nodes, 300 ms after the take was armed.
class SharedStudio {
 public:
  SharedStudio(size_t nodes, Network network, unsigned seed) : network_(network), random_(seed) {
    for (size_t i = 0; i < nodes; ++i) roster_.push_back("recon" + std::to_string(i + 1));
    for (size_t i = 0; i < nodes; ++i)
      nodes_.push_back(std::make_unique<Node>(setup(i, false), now_));
    for (int i = 0; i < 30; ++i) step();
  }

  void kill(size_t node) { nodes_[node].reset(); }
  void restart(size_t node) { nodes_[node] = std::make_unique<Node>(setup(node, true), now_); }
  void pause(size_t node, Duration time) { nodes_[node]->paused_until = now_ + time; }
  /// Makes a node drop a pulse, like a node that cannot keep up.
  void drop(size_t node, int64_t pulse) { nodes_[node]->drops.insert(pulse); }

  /// Makes a node start to process a pulse that much later, like a node without a processor.
  void delay(size_t node, int64_t pulse, Duration time) { nodes_[node]->delays[pulse] = time; }

  /// One pulse; the time advances by 40 ms.
  void pulse() {
    const size_t group = bus::FrameNumbers::group_of(pulses_, network_.groups);
    for (auto& node : nodes_) {
      if (node) node->shard.on_pulse(pulses_);
      if (!node || !node->shard.frame_groups().contains(group)) continue;
      if (!happens(network_.frames_lost)) node->sets.push_back(pulses_);
    }
    ++pulses_;
    for (int i = 0; i < 4; ++i) step();
  }
  void pulse(int count) {
    for (int i = 0; i < count; ++i) pulse();
  }
  /// Pulses whose frames reach no node; the time advances by 10 ms each.
  void miss(int count) {
    for (int i = 0; i < count; ++i, ++pulses_) step();
  }
  /// Advances the time until all nodes are settled; false after 60 s.
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
  const recond::Shard& shard(size_t node) const { return nodes_[node]->shard; }
  /// Pulses in the mesh file of a node.
  const std::vector<int64_t>& file(size_t node) const { return nodes_[node]->file; }
  /// Pulses published on V3D_MESH.
  const std::vector<int64_t>& published() const { return published_; }

 private:
  struct Node {
    Node(const recond::Shard::Setup& setup, MonotonicInstant now) : shard(setup, now) {}
    recond::Shard shard;
    std::deque<int64_t> sets;  ///< assembled, not yet passed to the shard
    std::deque<recon::ReadySet> work;
    MonotonicInstant work_done;
    MonotonicInstant next_status;
    MonotonicInstant paused_until;
    std::set<int64_t> drops;
    std::map<int64_t, Duration> delays;  ///< before the work on a pulse
    std::vector<int64_t> file;
  };
  struct Packet {
    MonotonicInstant due;
    int64_t number;
    size_t to;
    std::variant<wire::ShardMessage, wire::MeshMessage, int64_t>
        content;  ///< int64_t: pulse on V3D_MESH
    bool operator<(const Packet& other) const {
      return std::tie(other.due, other.number) < std::tie(due, number);
    }
  };

  recond::Shard::Setup setup(size_t node, bool joins_late) const {
    return {.take = kTake,
            .roster = roster_,
            .node = roster_[node],
            .rate_hz = 25,
            .joins_late = joins_late,
            .frame_groups = network_.groups};
  }
  bool happens(double probability) { return std::bernoulli_distribution(probability)(random_); }
  void send(size_t from, const decltype(Packet::content)& content) {
    for (size_t to = 0; to < nodes_.size(); ++to) {
      if (to == from || happens(network_.loss)) continue;
      std::uniform_int_distribution<int> delay(0, network_.max_delay_ms);
      in_flight_.push(
          {now_ + std::chrono::milliseconds(delay(random_)), next_number_++, to, content});
    }
  }
  void step() {
    now_ += kStep;
    while (!in_flight_.empty() && in_flight_.top().due <= now_) {
      const Packet packet = in_flight_.top();
      in_flight_.pop();
      if (nodes_[packet.to]) deliver(nodes_[packet.to]->shard, packet);
    }
    for (size_t i = 0; i < nodes_.size(); ++i) {
      if (nodes_[i] && nodes_[i]->paused_until <= now_) run_node(i, *nodes_[i]);
    }
  }
  static wire::MeshMessage mesh_of(int64_t pulse) {
    wire::MeshMessage mesh;
    mesh.take = kTake;
    mesh.pulse = pulse;
    return mesh;
  }
  static void deliver(recond::Shard& shard, const Packet& packet) {
    if (const auto* status = std::get_if<wire::ShardMessage>(&packet.content))
      shard.on_status(*status);
    if (const auto* mesh = std::get_if<wire::MeshMessage>(&packet.content)) shard.on_mesh(*mesh);
    if (const auto* pulse = std::get_if<int64_t>(&packet.content)) {
      shard.on_published(mesh_of(*pulse));
    }
  }
  void run_node(size_t i, Node& node) {
    for (; !node.sets.empty(); node.sets.pop_front()) {
      recon::ReadySet set;
      set.set.pulse = node.sets.front();
      node.shard.on_set(std::move(set));
    }
    work(i, node);
    node.shard.advance(now_);
    for (recon::ReadySet& set : node.shard.pop_work()) node.work.push_back(std::move(set));
    for (const wire::MeshMessage& mesh : node.shard.pop_ordered()) node.file.push_back(mesh.pulse);
    for (const wire::MeshMessage& mesh : node.shard.pop_to_publish()) {
      published_.push_back(mesh.pulse);
      send(i, mesh.pulse);
    }
    if (now_ < node.next_status) return;
    node.next_status = now_ + kStatusPeriod;
    wire::ShardMessage status = node.shard.status();
    status.sent = from_ns<Realtime>(to_ns(now_));
    send(i, status);
  }
  void work(size_t i, Node& node) {
    while (!node.work.empty() && node.work_done <= now_) {
      const int64_t pulse = node.work.front().set.pulse;
      if (const auto delayed = node.delays.extract(pulse)) {
        node.work_done = now_ + delayed.mapped();
        return;
      }
      node.work.pop_front();
      if (node.drops.contains(pulse)) {
        node.shard.give_up(pulse);
        continue;
      }
      if (!node.shard.begin(pulse)) continue;
      node.work_done = now_ + network_.work;
      send(i, mesh_of(pulse));
      node.shard.on_own_mesh(mesh_of(pulse));
    }
  }

  const Network network_;
  std::mt19937 random_;
  std::vector<std::string> roster_;
  std::vector<std::unique_ptr<Node>> nodes_;
  std::priority_queue<Packet> in_flight_;
  int64_t next_number_ = 0;
  MonotonicInstant now_ = from_ns<Monotonic>(1'000'000'000);
  int64_t pulses_ = 0;
  std::vector<int64_t> published_;
};

inline std::vector<int64_t> range(int64_t first, int64_t end) {
  std::vector<int64_t> pulses;
  for (int64_t pulse = first; pulse < end; ++pulse) pulses.push_back(pulse);
  return pulses;
}

/// The pulses that a viewer accepts: only ascending ones.
inline std::vector<int64_t> ascending(const std::vector<int64_t>& pulses) {
  std::vector<int64_t> seen;
  for (const int64_t pulse : pulses) {
    if (seen.empty() || pulse > seen.back()) seen.push_back(pulse);
  }
  return seen;
}

/// The pulses that a node has in its file or reports as without a mesh, ascending.
inline std::vector<int64_t> accounted(const SharedStudio& studio, size_t node) {
  std::vector<int64_t> all = studio.file(node);
  const auto without = studio.shard(node).without_mesh();
  all.insert(all.end(), without.begin(), without.end());
  std::sort(all.begin(), all.end());
  return all;
}

/// Expects all pulses from `first` to be accounted for, and the file to be ascending.
inline void expect_all_pulses_accounted(const SharedStudio& studio, size_t node, int64_t first) {
  EXPECT_TRUE(std::ranges::is_sorted(studio.file(node)));
  EXPECT_EQ(accounted(studio, node), range(first, studio.pulses())) << "node " << node;
}

}  // namespace v3d::test
