#include "daemon/control/command_replay_filter.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <random>

namespace v3d::control {
namespace {

using namespace std::chrono_literals;
using testing::HasSubstr;
using testing::IsEmpty;

constexpr MonotonicInstant kNow = from_ns<Monotonic>(3'600'000'000'000);
constexpr RealtimeInstant kSent = from_ns<Realtime>(1'700'000'000'000'000'000);

class CommandReplayFilterTest : public testing::Test {
 protected:
  CommandReplayFilterTest() { filter_.credentials().set_studio_key(key_, kNow); }

  static wire::CommandMessage command(int64_t nonce, int64_t counter = 1, Duration later = {},
                                      const std::string& sender = "anna@desk/1/2") {
    wire::CommandMessage m;
    m.sent = kSent + later;
    m.sender = sender;
    m.counter = counter;
    m.verb = wire::CommandVerb::kStart;
    m.take = "kendo-07";
    m.to = {"cap02", "cap01"};
    m.nonces = {1, nonce};
    return m;
  }
  /// Is the command admitted with a current nonce?
  bool admits(const wire::Bytes& bytes) {
    const auto admitted = filter_.admit(bytes, now_);
    return admitted && admitted->is_current;
  }
  bool admits(const wire::CommandMessage& m) { return admits(encode_with_mac(m, key_)); }
  /// Does the node reply with its nonce?
  bool replies_nonce(const wire::CommandMessage& m) {
    const auto admitted = filter_.admit(encode_with_mac(m, key_), now_);
    return admitted && !admitted->is_current;
  }
  int64_t nonce() { return filter_.nonce(now_); }

  const wire::StudioKey key_ = wire::StudioKey::make();
  MonotonicInstant now_ = kNow;
  CommandReplayFilter filter_{"cap01"};
};

TEST_F(CommandReplayFilterTest, admits_an_authentic_command_with_the_nonce_of_this_node) {
  const auto got = filter_.admit(encode_with_mac(command(nonce()), key_), now_);
  ASSERT_TRUE(got);
  EXPECT_TRUE(got->is_current);
  EXPECT_EQ(got->command.verb, wire::CommandVerb::kStart);
  EXPECT_EQ(filter_.counts().admitted, 1);
  EXPECT_THAT(filter_.problem(now_), IsEmpty());
}

TEST_F(CommandReplayFilterTest, replies_to_a_command_without_nonce_with_the_nonce_it_needs) {
  const wire::CommandMessage first = command(0);
  ASSERT_TRUE(replies_nonce(first));
  const wire::ReplyMessage reply = filter_.nonce_reply(first, now_);
  EXPECT_EQ(reply.outcome, wire::ReplyMessage::Outcome::kNonceMissing);
  EXPECT_EQ(reply.command_sender, first.sender);
  EXPECT_EQ(filter_.counts().without_nonce, 1);
  EXPECT_TRUE(admits(command(reply.nonce)));
}

TEST_F(CommandReplayFilterTest, admits_commands_independent_of_the_sender_s_clock) {
  EXPECT_TRUE(admits(command(nonce(), 1, -1h, "a")));
  EXPECT_TRUE(admits(command(nonce(), 1, 24h * 365, "b")));
}

TEST_F(CommandReplayFilterTest, rejects_a_nonce_older_than_ten_seconds) {
  const wire::CommandMessage held_back = command(nonce());
  now_ += 2 * CommandReplayFilter::kNonceLife - 1ms;
  EXPECT_TRUE(admits(held_back));
  const wire::CommandMessage later = command(nonce(), 1, 1s);
  now_ += 2 * CommandReplayFilter::kNonceLife;
  EXPECT_FALSE(admits(later));
  EXPECT_EQ(filter_.counts().without_nonce, 1);
}

TEST_F(CommandReplayFilterTest, rejects_the_nonce_of_another_node) {
  wire::CommandMessage swapped = command(nonce());
  std::swap(swapped.nonces[0], swapped.nonces[1]);
  EXPECT_FALSE(admits(swapped));
  swapped.nonces.clear();
  EXPECT_FALSE(admits(swapped));
}

TEST_F(CommandReplayFilterTest, rejects_all_commands_without_a_key) {
  CommandReplayFilter keyless("cap01");
  EXPECT_FALSE(keyless.admit(encode_with_mac(command(1), key_), now_));
  EXPECT_FALSE(keyless.admit(encode(command(1)), now_));
  EXPECT_EQ(keyless.counts().unkeyed, 2);
}

TEST_F(CommandReplayFilterTest, rejects_another_key_and_reports_it_for_ten_seconds) {
  EXPECT_FALSE(filter_.admit(encode_with_mac(command(nonce()), wire::StudioKey::make()), now_));
  EXPECT_EQ(filter_.counts().forged, 1);
  EXPECT_THAT(filter_.problem(now_ + 1s), HasSubstr("another studio key"));
  EXPECT_THAT(filter_.problem(now_ + 1min), IsEmpty());
}

TEST_F(CommandReplayFilterTest, admits_the_old_key_for_twenty_seconds_after_a_rotation) {
  const wire::StudioKey next = wire::StudioKey::make();
  EXPECT_FALSE(admits(encode_with_mac(command(nonce(), 1, 0s, "a"), next)));
  filter_.credentials().set_studio_key(next, now_);
  EXPECT_TRUE(admits(encode_with_mac(command(nonce(), 1, 0s, "b"), next)));
  now_ += 20s - 1ms;
  EXPECT_TRUE(admits(encode_with_mac(command(nonce(), 1, 0s, "c"), key_)));
  now_ += 1ms;
  EXPECT_FALSE(admits(encode_with_mac(command(nonce(), 1, 0s, "d"), key_)));
  EXPECT_TRUE(admits(encode_with_mac(command(nonce(), 1, 0s, "e"), next)));
  EXPECT_EQ(filter_.counts().forged, 2);
}

TEST_F(CommandReplayFilterTest, admits_operators_of_the_member_list_and_names_rejected_members) {
  const wire::SigningKey ada = wire::SigningKey::make(), guest = wire::SigningKey::make();
  CommandReplayFilter filter("cap01");
  filter.credentials().set_studio_key(key_, kNow);
  filter.credentials().require_members();
  filter.credentials().set_signing_key(wire::SigningKey::make());
  filter.credentials().set_members(std::make_shared<const wire::MemberList>(
      wire::MemberList{.studio = "kyoto",
                       .serial = 1,
                       .members = {{"ada", wire::Role::kOperator, ada.public_key()},
                                   {"guest", wire::Role::kViewer, guest.public_key()}}}));
  const wire::CommandMessage order = command(filter.nonce(now_));
  EXPECT_FALSE(filter.admit(sign_message(encode(order), guest), now_));
  EXPECT_EQ(filter.counts().unauthorized, 1);
  EXPECT_THAT(filter.problem(now_), HasSubstr("commands of guest are rejected"));
  EXPECT_FALSE(filter.admit(sign_message(encode(order), wire::SigningKey::make()), now_));
  EXPECT_FALSE(filter.admit(encode_with_mac(order, key_), now_));
  EXPECT_EQ(filter.counts().forged, 2);
  const auto admitted = filter.admit(sign_message(encode(order), ada), now_);
  ASSERT_TRUE(admitted);
  EXPECT_TRUE(admitted->is_current);
  EXPECT_FALSE(filter.admit(sign_message(encode(order), ada), now_)) << "a replay";
}

TEST_F(CommandReplayFilterTest, rejects_authentic_bytes_that_are_not_a_command) {
  EXPECT_FALSE(filter_.admit(encode_with_mac(wire::ReplyMessage{}, key_), now_));
  EXPECT_EQ(filter_.counts().malformed, 1);
}

TEST_F(CommandReplayFilterTest, admits_a_retry_that_was_sent_later_and_no_message_twice) {
  EXPECT_TRUE(admits(command(nonce(), 1)));
  EXPECT_FALSE(admits(command(nonce(), 1)));
  EXPECT_TRUE(admits(command(nonce(), 1, 200ms)));
  EXPECT_FALSE(admits(command(nonce(), 1)));
  EXPECT_TRUE(admits(command(nonce(), 2, 300ms)));
  EXPECT_FALSE(admits(command(nonce(), 1, 400ms)))
      << "a lower counter belongs to an earlier command";
  EXPECT_EQ(filter_.counts().replayed, 3);
}

TEST_F(CommandReplayFilterTest, admits_no_message_twice_while_its_nonce_is_valid) {
  const wire::CommandMessage recorded = command(nonce());
  ASSERT_TRUE(admits(recorded));
  for (int i = 0; i < 300; ++i) {
    now_ += 100ms;
    EXPECT_FALSE(admits(recorded)) << i;
    filter_.nonce(now_);
  }
}

TEST_F(CommandReplayFilterTest, ignores_commands_to_other_nodes) {
  wire::CommandMessage m = command(nonce());
  m.to = {"cap02", "cap03"};
  EXPECT_FALSE(filter_.admit(encode_with_mac(m, key_), now_));
  EXPECT_EQ(filter_.counts().without_nonce, 0);
}

TEST_F(CommandReplayFilterTest, rejects_commands_recorded_before_a_restart) {
  std::vector<wire::Bytes> recorded;
  for (int i = 0; i < 50; ++i) {
    recorded.push_back(encode_with_mac(command(nonce(), 1, i * 50ms, std::to_string(i)), key_));
    ASSERT_TRUE(admits(recorded.back()));
  }
  CommandReplayFilter restarted("cap01");
  restarted.credentials().set_studio_key(key_, now_);
  for (const wire::Bytes& bytes : recorded) {
    const auto admitted = restarted.admit(bytes, now_);
    EXPECT_FALSE(admitted && admitted->is_current);
  }
  EXPECT_EQ(restarted.counts().admitted, 0);
}

TEST_F(CommandReplayFilterTest, rejects_replays_when_there_are_too_many_senders) {
  std::vector<wire::Bytes> recorded;
  for (int i = 0; i < 1000; ++i) {
    recorded.push_back(
        encode_with_mac(command(nonce(), 1, {}, "sender" + std::to_string(i)), key_));
    ASSERT_TRUE(admits(recorded.back()));
    now_ += 1ms;
  }
  for (const wire::Bytes& bytes : recorded) EXPECT_FALSE(admits(bytes));
  EXPECT_EQ(filter_.counts().admitted, 1000);
}

TEST_F(CommandReplayFilterTest,
       answers_a_flood_of_recorded_commands_of_one_sender_20_times_a_second) {
  const wire::CommandMessage recorded = command(0, 1, {}, "yesterday");
  int replies = 0;
  for (int i = 0; i < 1000; ++i) replies += replies_nonce(recorded) ? 1 : 0;
  EXPECT_EQ(replies, CommandReplayFilter::kMaxNonceRepliesToSender);
  EXPECT_TRUE(replies_nonce(command(0, 1, {}, "operator"))) << "another sender has its own share";
  now_ += 1s;
  EXPECT_TRUE(replies_nonce(recorded));
}

TEST_F(CommandReplayFilterTest, answers_recorded_commands_of_many_senders_1000_times_a_second) {
  int replies = 0;
  for (int i = 0; i < 3000; ++i) {
    replies += replies_nonce(command(0, 1, {}, "sender" + std::to_string(i % 300))) ? 1 : 0;
  }
  EXPECT_EQ(replies, CommandReplayFilter::kMaxNonceReplies);
}

/// An attacker without the key: records, changes, repeats and forges commands.
class Attacker {
 public:
  explicit Attacker(const wire::StudioKey& key) : key_(key) {}

  /// Executed commands, as recorded by the attacker.
  std::vector<wire::Bytes> recorded;

  wire::Bytes replayed() { return recorded[random_() % recorded.size()]; }
  wire::Bytes bit_flipped() {
    wire::Bytes bytes = replayed();
    const size_t bit = random_() % (8 * bytes.size());
    bytes[bit / 8] ^= static_cast<uint8_t>(1 << bit % 8);
    return bytes;
  }
  /// With another key, or none; the attacker knows `nonce`.
  wire::Bytes forged(int64_t nonce) {
    wire::CommandMessage m;
    m.sent = kSent + 1h;
    m.sender = "attacker";
    m.counter = static_cast<int64_t>(random_());
    m.verb = static_cast<wire::CommandVerb>(1 + random_() % 6);
    m.to = {"cap01"};
    m.nonces = {nonce};
    return random_() % 2 != 0 ? encode_with_mac(m, own_) : encode(m);
  }
  /// Recorded when the node had an earlier nonce.
  wire::Bytes old() {
    wire::CommandMessage m;
    m.sent = kSent - std::chrono::minutes(1 + random_() % 1'000'000);
    m.sender = "anna@desk/1/" + std::to_string(random_());
    m.to = {"cap01"};
    m.nonces = {wire::random_nonce()};
    return encode_with_mac(m, key_);
  }

 private:
  const wire::StudioKey key_;
  const wire::StudioKey own_ = wire::StudioKey::make();
  std::mt19937 random_{7};
};

TEST_F(CommandReplayFilterTest, rejects_100_000_forged_replayed_old_and_changed_commands) {
  constexpr int kEach = 25'000;
  Attacker attacker(key_);
  for (int i = 1; i <= 40; ++i) {
    attacker.recorded.push_back(encode_with_mac(command(nonce(), i, i * 10ms), key_));
    ASSERT_TRUE(admits(attacker.recorded.back()));
  }
  const CommandCounts before = filter_.counts();
  for (int i = 0; i < kEach; ++i) {
    EXPECT_FALSE(admits(attacker.forged(nonce())));
    EXPECT_FALSE(admits(attacker.replayed()));
    EXPECT_FALSE(admits(attacker.old()));
    EXPECT_FALSE(admits(attacker.bit_flipped()));
  }
  const CommandCounts after = filter_.counts();
  EXPECT_EQ(after.admitted, before.admitted);
  EXPECT_EQ(after.forged, 2 * kEach);
  EXPECT_EQ(after.replayed, kEach);
  EXPECT_EQ(after.without_nonce, kEach);
  EXPECT_EQ(after.malformed + after.unkeyed, 0);
  EXPECT_TRUE(admits(command(nonce(), 41, 1s))) << "commands of the operator are still admitted";
}

}  // namespace
}  // namespace v3d::control
