// What a node of a shared take makes of what others say of themselves, whatever numbers stand in
// it: its stream rises, what it shows is of it, no pulse is both in it and named as missing, and
// everything is bounded.
#include "daemon/recond/shard.h"
#include "fuzz_input.h"

namespace {

using v3d::test::must;

constexpr size_t kMostMessages = 256;

/// Wraps, as what stands in a message may; messages have no pulse below -1.
int64_t near(int64_t pulse, int difference) {
  const auto sum =
      static_cast<int64_t>(static_cast<uint64_t>(pulse) + static_cast<uint64_t>(difference));
  return std::max<int64_t>(0, sum);
}

class Node {
 public:
  explicit Node(bool comes_later)
      : shard_({.take = "t",
                .roster = {"a", "b", "c"},
                .me = "b",
                .rate_hz = 25,
                .comes_later = comes_later}) {}

  void take(v3d::test::FuzzInput& input) {
    const auto byte = input.number<uint8_t>();
    // Near numbers are more telling than random ones.
    pulse_ = byte & 8 ? std::max<int64_t>(0, input.number<int64_t>())
                      : near(pulse_, input.number<int8_t>() % 8);
    now_ += std::chrono::milliseconds(4 * (byte >> 4));
    hear(byte & 7, input);
    shard_.turn(now_);
    look_at();
  }

 private:
  void hear(int kind, v3d::test::FuzzInput& input) {
    v3d::MeshMessage mesh;
    mesh.take = "t";
    mesh.pulse = pulse_;
    switch (kind) {
      case 0: {
        v3d::ReadySet set;
        set.set.pulse = pulse_;
        return shard_.add(std::move(set));
      }
      case 1:
        return shard_.hear(mesh);
      case 2:
        return shard_.made(mesh);
      case 3:
        return shard_.gave_up(pulse_);
      case 4:
        return shard_.heard_shown(mesh);
      default:
        return shard_.hear(word(input));
    }
  }
  v3d::ShardMessage word(v3d::test::FuzzInput& input) {
    v3d::ShardMessage word;
    word.sent = v3d::from_ns<v3d::Realtime>(input.number<int16_t>());
    word.take = "t";
    word.node = std::string(1, static_cast<char>('a' + input.number<uint8_t>() % 4));
    word.first = near(pulse_, input.number<int8_t>()) - 1;
    word.done = near(pulse_, input.number<int8_t>()) - 1;
    word.ordered = word.shown = near(pulse_, input.number<int8_t>()) - 1;
    word.given_up = {pulse_, near(pulse_, input.number<int8_t>())};
    return word;
  }
  void look_at() {
    for (const v3d::ReadySet& set : shard_.take_work()) {
      if (set.set.pulse % 2 == 0) shard_.begin(set.set.pulse);
    }
    for (const v3d::MeshMessage& mesh : shard_.take_ordered()) {
      must(mesh.pulse > ordered_);
      ordered_ = mesh.pulse;
    }
    for (const v3d::MeshMessage& mesh : shard_.take_to_show()) {
      must(mesh.pulse > shown_ && mesh.pulse <= ordered_);
      shown_ = mesh.pulse;
    }
    must(shard_.word().given_up.size() <= 64);
  }

  v3d::Shard shard_;
  v3d::MonotonicInstant now_;
  int64_t pulse_ = 0;
  int64_t ordered_ = -1;
  int64_t shown_ = -1;
};

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  v3d::test::FuzzInput input(data, size);
  Node node(input.number<uint8_t>() & 1);
  for (size_t i = 0; i < kMostMessages && !input.empty(); ++i) node.take(input);
  return 0;
}
