// Nodes that share a take, played on a simulated network: they die, stand still, come back, and
// what they say is lost, late and out of order.
#include "daemon/shard.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <memory>
#include <queue>
#include <random>
#include <set>

#include "daemon/shard_share.h"

namespace v3d {
namespace {

using std::chrono::milliseconds;

constexpr char kTake[] = "kendo-07";
constexpr Duration kStep = milliseconds(10);
constexpr Duration kWordEvery = milliseconds(100);

struct Network {
  double loss = 0;         ///< of the messages, for every receiver by itself
  int slowest_ms = 1;      ///< each takes from nothing to so long
  Duration work{};         ///< for one set
  double frames_lost = 0;  ///< sets that a node never had
  size_t groups = 1;       ///< in which frames travel
};

/// Loses messages and no frames, in one group.
Network any_network() {
  return {.loss = *rc::gen::inRange(0, 10) * 0.01,
          .slowest_ms = *rc::gen::inRange(1, 60),
          .work = milliseconds(*rc::gen::inRange(0, 40))};
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
      on_their_way_.push({now_ + milliseconds(delay(random_)), numbered_++, to, content});
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

std::vector<int64_t> range(int64_t first, int64_t end) {
  std::vector<int64_t> pulses;
  for (int64_t pulse = first; pulse < end; ++pulse) pulses.push_back(pulse);
  return pulses;
}

/// As a viewer sees them, who lets nothing go back.
std::vector<int64_t> without_returns(const std::vector<int64_t>& pulses) {
  std::vector<int64_t> seen;
  for (const int64_t pulse : pulses) {
    if (seen.empty() || pulse > seen.back()) seen.push_back(pulse);
  }
  return seen;
}

/// Every pulse is in the file or named.
void expect_every_pulse_told(const SharedStudio& studio, size_t node, int64_t first) {
  std::vector<int64_t> all = studio.file(node);
  EXPECT_TRUE(std::is_sorted(all.begin(), all.end()));
  const auto without = studio.shard(node).without_mesh();
  all.insert(all.end(), without.begin(), without.end());
  std::sort(all.begin(), all.end());
  EXPECT_EQ(all, range(first, studio.pulses())) << "node " << node;
}

TEST(Shard, shares_a_take_evenly_and_every_node_has_all_of_it) {
  SharedStudio studio(3, {.work = milliseconds(90)}, 1);
  studio.pulse(150);
  ASSERT_TRUE(studio.settle());
  for (size_t node = 0; node < 3; ++node) {
    EXPECT_EQ(studio.file(node), range(0, 150));
    const ShardCounts counts = studio.shard(node).counts();
    EXPECT_EQ(counts.made, 50);
    EXPECT_EQ(counts.taken_over + counts.repeated + counts.duplicates, 0);
    EXPECT_EQ(counts.living, 3);
  }
  EXPECT_EQ(studio.shown(), range(0, 150));
}

TEST(Shard, loses_nothing_of_a_node_that_dies) {
  for (size_t dead = 0; dead < 3; ++dead) {
    SharedStudio studio(3, {.slowest_ms = 20, .work = milliseconds(60)}, 2);
    studio.pulse(50);
    studio.kill(dead);
    studio.pulse(50);
    ASSERT_TRUE(studio.settle());
    for (size_t node = 0; node < 3; ++node) {
      if (node == dead) continue;
      EXPECT_EQ(studio.file(node), range(0, 100)) << dead;
      EXPECT_NEAR(static_cast<double>(studio.shard(node).counts().taken_over), 9, 2) << dead;
      EXPECT_EQ(studio.shard(node).counts().living, 2);
    }
    EXPECT_EQ(without_returns(studio.shown()), range(0, 100)) << dead;
    EXPECT_LE(std::ssize(studio.shown()), 101) << "at most the one on its way is shown twice";
  }
}

TEST(Shard, gives_a_share_to_a_node_that_comes_later) {
  for (const size_t late : {0, 2}) {
    SharedStudio studio(3, {.slowest_ms = 20, .work = milliseconds(30)}, 3);
    studio.pulse(30);
    studio.kill(late);
    studio.pulse(40);
    studio.start_anew(late);
    studio.pulse(100);
    ASSERT_TRUE(studio.settle());
    const int64_t first = studio.file(late).front();
    EXPECT_GT(first, 70);
    EXPECT_LE(first, 95);
    EXPECT_EQ(studio.file(late), range(first, 170));
    EXPECT_LE(std::abs(studio.shard(late).counts().made - (170 - first) / 3), 2);
    for (const size_t node : {1, late == 0 ? 2 : 0}) EXPECT_EQ(studio.file(node), range(0, 170));
    EXPECT_EQ(studio.shown(), range(0, 170)) << late;
  }
}

TEST(Shard, goes_on_when_all_but_one_have_died) {
  SharedStudio studio(3, {.work = milliseconds(10)}, 4);
  studio.pulse(20);
  studio.kill(0);
  studio.kill(2);
  studio.pulse(40);
  ASSERT_TRUE(studio.settle());
  EXPECT_EQ(studio.file(1), range(0, 60));
  EXPECT_EQ(without_returns(studio.shown()), range(0, 60));
}

TEST(Shard, passes_over_at_once_what_its_node_dropped_and_names_it) {
  SharedStudio studio(3, {.work = milliseconds(30)}, 5);
  for (const int64_t pulse : {10, 13, 21}) studio.drop(static_cast<size_t>(pulse % 3), pulse);
  studio.pulse(60);
  ASSERT_TRUE(studio.settle());
  for (size_t node = 0; node < 3; ++node) {
    EXPECT_EQ(studio.shard(node).without_mesh(), (std::vector<int64_t>{10, 13, 21}));
    EXPECT_EQ(studio.shard(node).counts().given_up, 3);
    EXPECT_EQ(studio.shard(node).counts().lost, 0);
    expect_every_pulse_told(studio, node, 0);
  }
}

TEST(Shard, takes_nobody_for_dead_because_it_stood_still_itself) {
  SharedStudio studio(3, {.work = milliseconds(30)}, 6);
  studio.pulse(25);
  for (size_t node = 0; node < 3; ++node) studio.hold_still(node, std::chrono::seconds(3));
  studio.pulse(25);
  studio.pulse(75);
  ASSERT_TRUE(studio.settle());
  for (size_t node = 0; node < 3; ++node) {
    EXPECT_EQ(studio.file(node), range(0, 125));
    EXPECT_EQ(studio.shard(node).counts().taken_over, 0);
  }
}

TEST(Shard, takes_one_back_that_was_only_slow) {
  for (size_t slow = 0; slow < 3; ++slow) {
    SharedStudio studio(3, {.work = milliseconds(20)}, 7);
    studio.pulse(25);
    studio.hold_still(slow, milliseconds(900));
    studio.pulse(100);
    ASSERT_TRUE(studio.settle());
    for (size_t node = 0; node < 3; ++node) EXPECT_EQ(studio.file(node), range(0, 125)) << slow;
    EXPECT_EQ(studio.shard(slow).counts().living, 3);
    EXPECT_EQ(without_returns(studio.shown()), range(0, 125)) << slow;
    EXPECT_GE(studio.shard(slow).counts().made, 30) << "it has its share again";
  }
}

TEST(Shard, makes_again_what_did_not_arrive) {
  SharedStudio studio(3, {.loss = 0.1, .slowest_ms = 30, .work = milliseconds(20)}, 8);
  studio.pulse(300);
  ASSERT_TRUE(studio.settle());
  int64_t repeated = 0;
  for (size_t node = 0; node < 3; ++node) {
    EXPECT_EQ(studio.file(node), range(0, 300));
    repeated += studio.shard(node).counts().repeated;
  }
  EXPECT_GT(repeated, 0);
}

TEST(Shard, names_a_pulse_that_nobody_has) {
  SharedStudio studio(2, {.work = milliseconds(20), .frames_lost = 0.4}, 9);
  studio.pulse(100);
  ASSERT_TRUE(studio.settle());
  EXPECT_GT(studio.shard(0).counts().lost, 0) << "neither node had its frames";
  EXPECT_LT(studio.shard(0).counts().lost, 40) << "one of them had those of the others";
  EXPECT_EQ(studio.file(0), studio.file(1));
}

TEST(ShardInGroups, hears_only_its_own_pulses_and_has_all_meshes) {
  for (const size_t groups : {3, 6}) {
    SharedStudio studio(3, {.work = milliseconds(90), .groups = groups}, 10);
    studio.pulse(150);
    ASSERT_TRUE(studio.settle());
    for (size_t node = 0; node < 3; ++node) {
      EXPECT_EQ(studio.file(node), range(0, 150));
      EXPECT_EQ(studio.shard(node).counts().made, 50);
      EXPECT_EQ(studio.shard(node).frame_groups(), groups_of(node, 3, groups));
    }
    EXPECT_EQ(studio.shown(), range(0, 150));
  }
}

TEST(ShardInGroups, loses_at_most_a_second_of_one_that_dies_and_names_it) {
  for (size_t dead = 0; dead < 3; ++dead) {
    SharedStudio studio(3, {.slowest_ms = 20, .work = milliseconds(60), .groups = 3}, 11);
    studio.pulse(50);
    studio.kill(dead);
    studio.pulse(100);
    ASSERT_TRUE(studio.settle());
    for (size_t node = 0; node < 3; ++node) {
      if (node == dead) continue;
      expect_every_pulse_told(studio, node, 0);
      const auto lost = studio.shard(node).without_mesh();
      EXPECT_LE(lost.size(), 8U) << "a third of the pulses of a second";
      for (const int64_t pulse : lost) {
        EXPECT_EQ(pulse % 3, static_cast<int64_t>(dead));
        EXPECT_LT(pulse, 75);
      }
      EXPECT_EQ(studio.shard(node).frame_groups(), (FrameGroupSet{node, dead}));
      EXPECT_GT(studio.shard(node).counts().taken_over, 10);
    }
  }
}

TEST(ShardInGroups, leaves_the_groups_of_one_that_came_back) {
  SharedStudio studio(3, {.slowest_ms = 20, .work = milliseconds(30), .groups = 3}, 12);
  studio.pulse(30);
  studio.kill(1);
  studio.pulse(40);
  studio.start_anew(1);
  studio.pulse(100);
  ASSERT_TRUE(studio.settle());
  for (size_t node = 0; node < 3; ++node) {
    EXPECT_EQ(studio.shard(node).frame_groups(), groups_of(node, 3, 3));
  }
  const int64_t first = studio.file(1).front();
  EXPECT_EQ(studio.file(1), range(first, 170));
  for (const size_t node : {0, 2}) {
    expect_every_pulse_told(studio, node, 0);
    for (const int64_t pulse : studio.shard(node).without_mesh()) EXPECT_LT(pulse, 55);
  }
}

TEST(ShardInGroups, makes_no_mesh_of_a_set_that_was_cut_when_it_joined) {
  Shard shard({.take = kTake, .roster = {"recon1", "recon2"}, .me = "recon1", .frame_groups = 2});
  MonotonicInstant now = from_ns<Monotonic>(1'000'000'000);
  const auto set_of = [](int64_t pulse, const std::vector<std::string>& missing) {
    ReadySet ready;
    ready.set.pulse = pulse;
    ready.missing = missing;
    return ready;
  };
  ShardMessage alive;
  alive.take = kTake;
  alive.node = "recon2";
  alive.first = 0;
  alive.sent = from_ns<Realtime>(1);
  shard.turn(now);
  shard.hear(alive);
  shard.turn(now += milliseconds(50));
  EXPECT_EQ(shard.frame_groups(), FrameGroupSet{0});
  for (int i = 0; i < 10; ++i) shard.turn(now += milliseconds(50));
  EXPECT_EQ(shard.frame_groups(), (FrameGroupSet{0, 1})) << "the other is silent";
  shard.add(set_of(5, {"cam02"}));
  shard.add(set_of(6, {"cam02"}));
  shard.add(set_of(7, {"cam02"}));
  shard.turn(now += milliseconds(50));
  std::vector<int64_t> work;
  for (const ReadySet& set : shard.take_work()) work.push_back(set.set.pulse);
  EXPECT_EQ(work, (std::vector<int64_t>{6, 7})) << "5 is the first of its group";
}

RC_GTEST_PROP(ShardInGroups, tells_of_every_pulse_whoever_dies_on_whatever_network, ()) {
  const auto nodes = *rc::gen::inRange<size_t>(1, 5);
  Network network = any_network();
  network.frames_lost = *rc::gen::inRange(0, 10) * 0.01;
  network.groups = *rc::gen::inRange<size_t>(1, 7);
  SharedStudio studio(nodes, network, *rc::gen::arbitrary<unsigned>());
  studio.pulse(*rc::gen::inRange(1, 40));
  const auto dead = *rc::gen::inRange<size_t>(0, nodes);
  if (nodes > 1) studio.kill(dead);
  studio.pulse(*rc::gen::inRange(30, 60));
  RC_ASSERT(studio.settle());
  for (size_t node = 0; node < nodes; ++node) {
    if (nodes > 1 && node == dead) continue;
    std::vector<int64_t> all = studio.file(node);
    RC_ASSERT(std::is_sorted(all.begin(), all.end()));
    const auto without = studio.shard(node).without_mesh();
    all.insert(all.end(), without.begin(), without.end());
    std::sort(all.begin(), all.end());
    RC_ASSERT(all == range(0, std::ssize(all)));
    RC_ASSERT(std::ssize(all) >= studio.pulses() - 10);
  }
}

RC_GTEST_PROP(Shard, tells_of_every_pulse_whoever_dies_on_whatever_network, ()) {
  const auto nodes = *rc::gen::inRange<size_t>(1, 5);
  const Network network = any_network();
  SharedStudio studio(nodes, network, *rc::gen::arbitrary<unsigned>());
  studio.pulse(*rc::gen::inRange(0, 40));
  const auto dead = *rc::gen::inRange<size_t>(0, nodes);
  if (nodes > 1) studio.kill(dead);
  studio.pulse(*rc::gen::inRange(30, 60));
  RC_ASSERT(studio.settle());
  for (size_t node = 0; node < nodes; ++node) {
    if (nodes > 1 && node == dead) continue;
    RC_ASSERT(studio.file(node) == range(0, studio.pulses()));
    RC_ASSERT(studio.shard(node).without_mesh().empty());
  }
  RC_ASSERT(without_returns(studio.shown()) == range(0, studio.pulses()));
}

TEST(Shard, holds_a_bounded_number_of_sets_of_others) {
  Shard shard({.take = kTake, .roster = {"recon1", "recon2"}, .me = "recon1"});
  MonotonicInstant now = from_ns<Monotonic>(1'000'000'000);
  ShardMessage alive;
  alive.take = kTake;
  alive.node = "recon2";
  alive.first = 0;
  for (int64_t pulse = 0; pulse < 600; ++pulse) {
    alive.sent += milliseconds(40);
    shard.hear(alive);
    shard.turn(now += milliseconds(40));
    ReadySet set;
    set.set.pulse = pulse;
    shard.add(std::move(set));
    for (const ReadySet& mine : shard.take_work()) shard.gave_up(mine.set.pulse);
  }
  EXPECT_EQ(shard.counts().let_go, 300 - static_cast<int64_t>(Shard::kMostHeld));
  EXPECT_GT(shard.counts().lost, 0) << "a node that promises for ever is not waited for";
}

TEST(Shard, believes_no_stranger_and_no_other_take) {
  Shard shard({.take = kTake, .roster = {"recon1", "recon2"}, .me = "recon1"});
  ShardMessage word;
  word.take = "kendo-06";
  word.node = "recon2";
  word.first = 0;
  shard.turn(from_ns<Monotonic>(1));
  shard.hear(word);
  word.take = kTake;
  word.node = "recon9";
  shard.hear(word);
  EXPECT_EQ(shard.counts().living, 1);
  word.node = "recon2";
  shard.hear(word);
  EXPECT_EQ(shard.counts().living, 2);
  MeshMessage mesh;
  mesh.take = "kendo-06";
  shard.hear(mesh);
  shard.turn(from_ns<Monotonic>(2));
  EXPECT_TRUE(shard.take_ordered().empty());
}

}  // namespace
}  // namespace v3d
