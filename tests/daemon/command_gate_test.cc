#include "daemon/command_gate.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <random>

namespace v3d {
namespace {

using namespace std::chrono_literals;
using testing::HasSubstr;
using testing::IsEmpty;

constexpr RealtimeInstant kBegan = from_ns<Realtime>(1'700'000'000'000'000'000);

class Gate : public testing::Test {
 protected:
  Gate() { gate_.set_key(key_); }

  static CommandMessage command(RealtimeInstant sent, int64_t counter = 1,
                                const std::string& sender = "anna@desk/1/2") {
    CommandMessage m;
    m.sent = sent;
    m.sender = sender;
    m.counter = counter;
    m.verb = CommandVerb::kStart;
    m.take = "kendo-07";
    m.to = {"cap01"};
    return m;
  }
  bool admits(const CommandMessage& m) {
    return gate_.admit(encode_sealed(m, key_), now_).has_value();
  }

  const StudioKey key_ = StudioKey::make();
  CommandGate gate_{"cap01", kBegan};
  RealtimeInstant now_ = kBegan + 60s;
};

TEST_F(Gate, believes_a_sealed_command_of_now) {
  const auto got = gate_.admit(encode_sealed(command(now_), key_), now_);
  ASSERT_TRUE(got);
  EXPECT_EQ(got->verb, CommandVerb::kStart);
  EXPECT_EQ(gate_.counts().believed, 1);
  EXPECT_THAT(gate_.trouble(now_), IsEmpty());
}

TEST_F(Gate, believes_nobody_without_a_key) {
  CommandGate keyless("cap01", kBegan);
  EXPECT_FALSE(keyless.admit(encode_sealed(command(now_), key_), now_));
  EXPECT_FALSE(keyless.admit(encode(command(now_)), now_));
  EXPECT_EQ(keyless.counts().unkeyed, 2);
}

TEST_F(Gate, refuses_what_another_key_sealed_and_says_so_for_a_while) {
  EXPECT_FALSE(gate_.admit(encode_sealed(command(now_), StudioKey::make()), now_));
  EXPECT_EQ(gate_.counts().forged, 1);
  EXPECT_THAT(gate_.trouble(now_ + 1s), HasSubstr("another studio key"));
  EXPECT_THAT(gate_.trouble(now_ + 1min), IsEmpty());
}

TEST_F(Gate, refuses_sealed_bytes_that_are_no_command) {
  EXPECT_FALSE(gate_.admit(encode_sealed(ReplyMessage{}, key_), now_));
  EXPECT_EQ(gate_.counts().malformed, 1);
}

TEST_F(Gate, allows_for_slow_networks_and_for_clocks_that_differ_a_little) {
  EXPECT_TRUE(admits(command(now_ - 5s, 1, "a")));
  EXPECT_TRUE(admits(command(now_ + 2s, 1, "b")));
  EXPECT_FALSE(admits(command(now_ - 5s - 1us, 1, "c")));
  EXPECT_FALSE(admits(command(now_ + 2s + 1us, 1, "d")));
  EXPECT_EQ(gate_.counts().stale, 2);
  EXPECT_THAT(gate_.trouble(now_), HasSubstr("do the clocks agree"));
}

TEST_F(Gate, admits_a_retry_that_was_sent_later_and_no_message_twice) {
  EXPECT_TRUE(admits(command(now_, 1)));
  EXPECT_FALSE(admits(command(now_, 1)));
  EXPECT_TRUE(admits(command(now_ + 200ms, 1)));
  EXPECT_FALSE(admits(command(now_, 1)));
  EXPECT_TRUE(admits(command(now_ + 300ms, 2)));
  EXPECT_FALSE(admits(command(now_ + 400ms, 1))) << "a lower counter is a command of before";
  EXPECT_EQ(gate_.counts().replayed, 3);
}

TEST_F(Gate, remembers_what_was_meant_for_others_too) {
  CommandMessage m = command(now_);
  m.to = {"cap02"};
  EXPECT_FALSE(admits(m));
  EXPECT_EQ(gate_.counts().believed, 1);
  EXPECT_FALSE(admits(m));
  EXPECT_EQ(gate_.counts().replayed, 1);
}

TEST_F(Gate, leaves_no_hole_when_a_daemon_starts_anew) {
  // Whatever the daemon believed before it ended, and a little more.
  std::vector<Bytes> recorded;
  for (int i = 0; i < 100; ++i) {
    const CommandMessage m = command(now_ + i * 50ms, 1, "sender" + std::to_string(i));
    if (gate_.admit(encode_sealed(m, key_), now_)) recorded.push_back(encode_sealed(m, key_));
  }
  ASSERT_EQ(recorded.size(), 41U) << "up to two seconds ahead";
  CommandGate anew("cap01", now_);
  anew.set_key(key_);
  for (const Duration later : {0s, 1s, 2s, 4s, 8s}) {
    for (const Bytes& bytes : recorded) EXPECT_FALSE(anew.admit(bytes, now_ + later));
  }
  EXPECT_EQ(anew.counts().believed, 0);
  const RealtimeInstant soon = now_ + CommandGate::kAhead + 1us;
  EXPECT_TRUE(anew.admit(encode_sealed(command(soon), key_), soon)) << "the operator's next retry";
}

TEST_F(Gate, leaves_no_hole_where_it_cannot_remember_all_senders) {
  std::vector<Bytes> recorded;
  for (int i = 0; i < 1000; ++i) {
    const RealtimeInstant sent = now_ + i * 1ms;
    recorded.push_back(encode_sealed(command(sent, 1, "sender" + std::to_string(i)), key_));
    ASSERT_TRUE(gate_.admit(recorded.back(), sent));
  }
  for (const Bytes& bytes : recorded) EXPECT_FALSE(gate_.admit(bytes, now_ + 1s));
  EXPECT_EQ(gate_.counts().believed, 1000);
}

/// What a stranger can do without the key: record, change, repeat, invent.
class Stranger {
 public:
  Stranger(const StudioKey& key, RealtimeInstant now) : key_(key), now_(now) {}

  /// Commands that were carried out, as he recorded them.
  std::vector<Bytes> recorded;

  Bytes replayed() { return recorded[random_() % recorded.size()]; }
  Bytes bit_flipped() {
    Bytes bytes = replayed();
    const size_t bit = random_() % (8 * bytes.size());
    bytes[bit / 8] ^= static_cast<uint8_t>(1 << bit % 8);
    return bytes;
  }
  /// With a key of his own, or none.
  Bytes forged() {
    CommandMessage m;
    m.sent = now_;
    m.sender = "stranger";
    m.counter = static_cast<int64_t>(random_());
    m.verb = static_cast<CommandVerb>(1 + random_() % 6);
    m.to = {"cap01"};
    return random_() % 2 != 0 ? encode_sealed(m, own_) : encode(m);
  }
  /// Held back by him on its way, and let go much later.
  Bytes stale() {
    CommandMessage m;
    const auto minutes = std::chrono::minutes(1 + random_() % 1'000'000);
    m.sent = now_ - minutes;
    m.sender = "anna@desk/1/" + std::to_string(random_());
    m.to = {"cap01"};
    return encode_sealed(m, key_);
  }

 private:
  const StudioKey key_;
  const StudioKey own_ = StudioKey::make();
  const RealtimeInstant now_;
  std::mt19937 random_{7};
};

TEST_F(Gate, admits_none_of_100_000_forged_replayed_stale_and_changed_commands) {
  constexpr int kEach = 25'000;
  Stranger stranger(key_, now_);
  for (int i = 1; i <= 40; ++i) {
    stranger.recorded.push_back(encode_sealed(command(now_ + i * 10ms, i), key_));
    ASSERT_TRUE(gate_.admit(stranger.recorded.back(), now_));
  }
  const CommandCounts before = gate_.counts();
  for (int i = 0; i < kEach; ++i) {
    EXPECT_FALSE(gate_.admit(stranger.forged(), now_));
    EXPECT_FALSE(gate_.admit(stranger.replayed(), now_));
    EXPECT_FALSE(gate_.admit(stranger.stale(), now_));
    EXPECT_FALSE(gate_.admit(stranger.bit_flipped(), now_));
  }
  const CommandCounts after = gate_.counts();
  EXPECT_EQ(after.believed, before.believed);
  EXPECT_EQ(after.forged, 2 * kEach);
  EXPECT_EQ(after.replayed, kEach);
  EXPECT_EQ(after.stale, kEach);
  EXPECT_EQ(after.malformed + after.early + after.unkeyed, 0);
  EXPECT_TRUE(admits(command(now_ + 1s, 41))) << "the operator is heard all the same";
}

}  // namespace
}  // namespace v3d
