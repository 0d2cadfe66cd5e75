// Fuzz target: a Shard that receives arbitrary status messages, sets and meshes. Its ordered stream
// ascends, it publishes only meshes of that stream, and its status stays bounded.
#include "daemon/recond/shard.h"
#include "fuzz_input.h"

namespace {

using v3d::test::must;

constexpr size_t kMaxMessages = 256;

/// Wraps around, because messages may hold any number; they hold no pulse below -1.
int64_t near(int64_t pulse, int difference) {
  const auto sum =
      static_cast<int64_t>(static_cast<uint64_t>(pulse) + static_cast<uint64_t>(difference));
  return std::max<int64_t>(0, sum);
}

class Node {
 public:
  explicit Node(bool joins_late)
      : shard_({.take = "t",
                .roster = {"a", "b", "c"},
                .node = "b",
                .rate_hz = 25,
                .joins_late = joins_late},
               v3d::MonotonicInstant()) {}

  void take(v3d::test::FuzzInput& input) {
    const auto byte = input.number<uint8_t>();
    // Numbers near the previous one reach more code than random ones.
    pulse_ = byte & 8 ? std::max<int64_t>(0, input.number<int64_t>())
                      : near(pulse_, input.number<int8_t>() % 8);
    now_ += std::chrono::milliseconds(4 * (byte >> 4));
    send(byte & 7, input);
    shard_.advance(now_);
    check();
  }

 private:
  void send(int kind, v3d::test::FuzzInput& input) {
    v3d::wire::MeshMessage mesh;
    mesh.take = "t";
    mesh.pulse = pulse_;
    switch (kind) {
      case 0: {
        v3d::recon::ReadySet set;
        set.set.pulse = pulse_;
        return shard_.on_set(std::move(set));
      }
      case 1:
        return shard_.on_mesh(mesh);
      case 2:
        return shard_.on_own_mesh(mesh);
      case 3:
        return shard_.give_up(pulse_);
      case 4:
        return shard_.on_published(mesh);
      default:
        return shard_.on_status(any_status(input));
    }
  }
  v3d::wire::ShardMessage any_status(v3d::test::FuzzInput& input) {
    v3d::wire::ShardMessage status;
    status.sent = v3d::from_ns<v3d::Realtime>(input.number<int16_t>());
    status.take = "t";
    status.node = std::string(1, static_cast<char>('a' + input.number<uint8_t>() % 4));
    status.first = near(pulse_, input.number<int8_t>()) - 1;
    status.done = near(pulse_, input.number<int8_t>()) - 1;
    status.ordered = status.shown = near(pulse_, input.number<int8_t>()) - 1;
    status.given_up = {pulse_, near(pulse_, input.number<int8_t>())};
    return status;
  }
  void check() {
    for (const v3d::recon::ReadySet& set : shard_.pop_work()) {
      if (set.set.pulse % 2 == 0) shard_.begin(set.set.pulse);
    }
    for (const v3d::wire::MeshMessage& mesh : shard_.pop_ordered()) {
      must(mesh.pulse > ordered_);
      ordered_ = mesh.pulse;
    }
    for (const v3d::wire::MeshMessage& mesh : shard_.pop_to_publish()) {
      must(mesh.pulse > published_ && mesh.pulse <= ordered_);
      published_ = mesh.pulse;
    }
    must(shard_.status().given_up.size() <= 64);
  }

  v3d::recond::Shard shard_;
  v3d::MonotonicInstant now_;
  int64_t pulse_ = 0;
  int64_t ordered_ = -1;
  int64_t published_ = -1;
};

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  v3d::test::FuzzInput input(data, size);
  Node node(input.number<uint8_t>() & 1);
  for (size_t i = 0; i < kMaxMessages && !input.empty(); ++i) node.take(input);
  return 0;
}
