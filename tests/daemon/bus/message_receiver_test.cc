// Tests of MessageReceiver with authentic, forged and replayed datagrams. This program counts every
// allocation.
#include "daemon/bus/message_receiver.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <algorithm>
#include <random>

#include "datagram_sender.h"
#include "support/allocation_count.h"
#include "wire/messages.h"

namespace v3d::bus {
namespace {

using namespace std::chrono_literals;
using test::RawDatagram;
using Sender = test::DatagramSender;

using test::kNow;
using test::kReceiverNow;
constexpr uint64_t kSource = 1;

Studio studio() {
  Studio studio;
  studio.nodes = {{"cap01"}};
  studio.cameras.resize(1);
  studio.cameras[0].name = "cam01";
  return studio;
}

class Receiver : public testing::Test {
 protected:
  Receiver() { authenticator_.set_key(key_); }

  std::optional<ReceivedMessage> receive(const RawDatagram& bytes, Duration delay = {}) {
    return receiver_.receive(bytes, kSource, {kReceiverNow.monotonic + delay, kNow + delay});
  }
  static std::vector<uint8_t> message(size_t size) {
    std::vector<uint8_t> bytes(size);
    for (size_t i = 0; i < size; ++i) bytes[i] = static_cast<uint8_t>(i * 31 + i / 256);
    return bytes;
  }

  const wire::StudioKey key_ = wire::StudioKey::make();
  MessageAuthenticator authenticator_;
  static constexpr uint32_t kOwnSession = 77;
  std::vector<wire::SessionMessage> sent_;
  std::string_view unwanted_ = "V3D_PREVIEW_cam01";
  MessageReceiver receiver_{
      ChannelList(studio()),
      authenticator_,
      [this](std::string_view channel) { return channel != unwanted_; },
      {.newest_of_own = [](uint32_t session) -> std::optional<uint32_t> {
         if (session != kOwnSession) return std::nullopt;
         return 41;
       },
       .send = [this](const wire::SessionMessage& m) { sent_.push_back(m); }}};
  Sender sender_{key_};
};

TEST_F(Receiver, returns_a_message_without_its_trailer) {
  const auto sent = message(100);
  const RawDatagram datagram = sender_.datagrams(wire::kEventChannel, sent).at(0);
  const auto got = receive(datagram);
  ASSERT_TRUE(got);
  EXPECT_EQ(got->channel, wire::kEventChannel);
  EXPECT_THAT(got->bytes, testing::ElementsAreArray(sent));
}

TEST_F(Receiver, returns_the_session_of_short_and_long_messages) {
  const auto last_of = [&](Sender& sender, size_t size) {
    std::optional<ReceivedMessage> got;
    for (const RawDatagram& datagram : sender.datagrams("V3D_FRAME_cam01", message(size))) {
      got = receive(datagram);
    }
    return got.value().session;
  };
  Sender restarted(key_);
  for (const size_t size : {100U, 300'000U}) {
    EXPECT_EQ(last_of(sender_, size), sender_.session);
    EXPECT_EQ(last_of(restarted, size), restarted.session);
  }
}

TEST_F(Receiver, returns_when_a_message_was_sent_by_the_clocks_of_sender_and_receiver) {
  const auto received = [&](Duration sent_after, Duration received_after) {
    const auto datagrams = sender_.datagrams(wire::kEventChannel, message(100), kNow + sent_after);
    return receive(datagrams.at(0), received_after).value();
  };
  EXPECT_EQ(received(0s, 0s).sent, kNow);
  const ReceivedMessage late = received(100ms, 400ms);
  EXPECT_EQ(late.sent, kNow + 100ms);
  EXPECT_LE(late.age, 300ms);
  EXPECT_GE(late.age, 299ms) << "less the largest drift of the clocks";
  EXPECT_EQ(late.sent_here, kReceiverNow.monotonic + 100ms);
}

TEST_F(Receiver, returns_a_long_message_for_any_order_of_its_datagrams) {
  std::mt19937 random(7);
  const auto sent = message(300'000);
  for (int i = 0; i < 20; ++i) {
    auto datagrams = sender_.datagrams("V3D_FRAME_cam01", sent);
    std::shuffle(datagrams.begin(), datagrams.end(), random);
    std::optional<ReceivedMessage> got;
    for (const RawDatagram& datagram : datagrams) {
      ASSERT_FALSE(got);
      got = receive(datagram);
    }
    ASSERT_TRUE(got);
    EXPECT_TRUE(std::ranges::equal(got->bytes, sent));
  }
}

TEST_F(Receiver, accepts_both_keys_for_twenty_seconds_after_a_new_one_was_set) {
  const wire::StudioKey next = wire::StudioKey::make();
  Sender renewed(next);
  const auto accepts = [&](Sender& sender, Duration delay) {
    const auto sent = sender.datagrams(wire::kEventChannel, message(100), kNow + delay).at(0);
    return receive(sent, delay).has_value();
  };
  EXPECT_FALSE(accepts(renewed, 0s));
  authenticator_.set_key(next, kReceiverNow.monotonic);
  EXPECT_TRUE(accepts(renewed, 1s));
  EXPECT_TRUE(accepts(sender_, 20s - 1ms));
  EXPECT_FALSE(accepts(sender_, 20s));
  EXPECT_TRUE(accepts(renewed, 20s));
  EXPECT_EQ(authenticator_.counts().forged, 2);
}

TEST_F(Receiver, rejects_commands_and_replies_without_a_mac_although_they_contain_their_own) {
  const auto without_mac = [&](std::string_view channel) {
    RawDatagram bytes;
    const auto sent = message(100);
    for (const OutgoingDatagram& datagram : split_message(1, channel, sent, false)) {
      bytes.assign(datagram.head().begin(), datagram.head().end());
      bytes.insert(bytes.end(), datagram.data.begin(), datagram.data.end());
    }
    return bytes;
  };
  for (const char* channel : {wire::kCommandChannel, wire::kReplyChannel}) {
    EXPECT_FALSE(receive(without_mac(channel))) << channel;
    const auto sent = sender_.datagrams(channel, message(100)).at(0);
    const auto got = receive(sent);
    ASSERT_TRUE(got) << channel;
    EXPECT_THAT(got->bytes, testing::ElementsAreArray(message(100)));
    EXPECT_FALSE(receive(sent)) << "a replay";
  }
  EXPECT_EQ(authenticator_.counts().forged, 2);
  EXPECT_EQ(authenticator_.counts().replayed, 2);
}

TEST_F(Receiver, rejects_a_datagram_with_any_bit_flipped) {
  const RawDatagram whole = sender_.datagrams(wire::kEventChannel, message(40)).at(0);
  for (size_t bit = 0; bit < 8 * whole.size(); ++bit) {
    RawDatagram changed = whole;
    changed[bit / 8] ^= static_cast<uint8_t>(1 << bit % 8);
    EXPECT_FALSE(receive(changed)) << "bit " << bit;
  }
  EXPECT_TRUE(receive(whole));
}

TEST_F(Receiver, rejects_each_fragment_with_a_changed_header) {
  const auto sent = message(200'000);
  for (size_t bit = 0; bit < 8 * 20; ++bit) {
    auto datagrams = sender_.datagrams("V3D_FRAME_cam01", sent);
    for (RawDatagram datagram : datagrams) {
      datagram[bit / 8] ^= static_cast<uint8_t>(1 << bit % 8);
      EXPECT_FALSE(receive(datagram)) << "bit " << bit;
    }
    std::optional<ReceivedMessage> got;
    for (const RawDatagram& datagram : datagrams) got = receive(datagram);
    ASSERT_TRUE(got) << "changed fragments had an effect, bit " << bit;
    EXPECT_TRUE(std::ranges::equal(got->bytes, sent));
  }
}

TEST_F(Receiver, rejects_fragments_of_different_messages_as_one_message) {
  const auto a = sender_.datagrams("V3D_FRAME_cam01", message(100'000));
  Sender other(key_);
  const auto b = other.datagrams("V3D_FRAME_cam01", message(100'000));
  EXPECT_FALSE(receive(a[0]));
  EXPECT_FALSE(receive(b[1])) << "same number and sizes, another session";
  EXPECT_TRUE(receive(a[1]));
}

TEST_F(Receiver, rejects_replayed_old_and_future_messages) {
  const RawDatagram first = sender_.datagrams(wire::kEventChannel, message(40)).at(0);
  EXPECT_TRUE(receive(first));
  EXPECT_FALSE(receive(first));
  EXPECT_EQ(authenticator_.counts().replayed, 1);
  const auto frame = sender_.datagrams("V3D_FRAME_cam01", message(100'000));
  EXPECT_FALSE(receive(frame[0]));
  EXPECT_TRUE(receive(frame[1]));
  EXPECT_FALSE(receive(frame[0]));
  EXPECT_FALSE(receive(frame[1]));
  EXPECT_EQ(authenticator_.counts().replayed, 2);
  EXPECT_FALSE(receive(sender_.datagrams(wire::kEventChannel, message(40), kNow - 6s).at(0)));
  EXPECT_FALSE(receive(sender_.datagrams(wire::kEventChannel, message(40), kNow + 3s).at(0)));
  EXPECT_EQ(authenticator_.counts().stale, 2);
}

TEST_F(Receiver, challenges_a_session_whose_clock_differs_and_accepts_it_when_it_responds) {
  const Duration hour = -1h;
  EXPECT_FALSE(receive(sender_.datagrams(wire::kEventChannel, message(40), kNow + hour).at(0)));
  ASSERT_EQ(sent_.size(), 1U);
  const wire::SessionMessage challenge = sent_[0];
  EXPECT_EQ(challenge.session, sender_.session);
  EXPECT_FALSE(receive(sender_.datagrams(wire::kEventChannel, message(40), kNow + hour).at(0)));
  EXPECT_EQ(sent_.size(), 1U) << "the last challenge was just sent";
  wire::SessionMessage response = challenge;
  response.is_answer = true;
  response.newest = 2;
  wire::SessionMessage guessed = response;
  guessed.nonce ^= 1;
  receive(sender_.datagrams(wire::kSessionChannel, encode(guessed), kNow + hour).at(0));
  EXPECT_FALSE(receive(sender_.datagrams(wire::kEventChannel, message(40), kNow + hour).at(0)));
  response.newest = 4;
  receive(sender_.datagrams(wire::kSessionChannel, encode(response), kNow + hour).at(0));
  EXPECT_TRUE(receive(sender_.datagrams(wire::kEventChannel, message(40), kNow + hour).at(0)));
  EXPECT_THAT(authenticator_.trouble(Monotonic::now()), testing::HasSubstr("3600.0 s behind"));
  EXPECT_TRUE(
      receive(sender_.datagrams(wire::kEventChannel, message(40), kNow + hour + 60s).at(0), 60s))
      << "the session stays accepted";
  EXPECT_EQ(authenticator_.counts().stale, 3);
}

TEST_F(Receiver, rejects_recorded_messages_with_recorded_responses) {
  Sender recorded(key_);
  const Duration hour = -1h;
  const RawDatagram event = recorded.datagrams(wire::kEventChannel, message(40), kNow + hour).at(0);
  wire::SessionMessage old;
  old.session = recorded.session;
  old.nonce = 12345;
  old.is_answer = true;
  const RawDatagram response =
      recorded.datagrams(wire::kSessionChannel, encode(old), kNow + hour).at(0);
  for (int i = 0; i < 10; ++i) {
    EXPECT_FALSE(receive(event, i * 1s));
    receive(response, i * 1s);
  }
  EXPECT_EQ(sent_.size(), 10U);
}

wire::SessionMessage response_to(wire::SessionMessage challenge, uint32_t newest) {
  challenge.newest = newest;
  challenge.is_answer = true;
  return challenge;
}

/// The response of `sender` to `challenge`.
RawDatagram response_of(Sender& sender, const wire::SessionMessage& challenge, uint32_t newest) {
  return sender.datagrams(wire::kSessionChannel, encode(response_to(challenge, newest))).at(0);
}

TEST_F(Receiver, accepts_health_and_pulses_only_from_a_session_that_has_responded) {
  for (const char* const channel : {"V3D_HEALTH_cap01", wire::kPulseChannel}) {
    Sender sender(key_);
    EXPECT_TRUE(receive(sender.datagrams(wire::kEventChannel, message(40)).at(0)));
    const RawDatagram older = sender.datagrams(channel, message(40)).at(0);
    EXPECT_FALSE(receive(sender.datagrams(channel, message(40)).at(0)));
    ASSERT_FALSE(sent_.empty());
    ASSERT_EQ(sent_.back().session, sender.session);
    receive(response_of(sender, sent_.back(), 2));
    EXPECT_FALSE(receive(older)) << "it may have been received before a restart";
    EXPECT_TRUE(receive(sender.datagrams(channel, message(40)).at(0)));
  }
  EXPECT_EQ(authenticator_.counts().stale, 0);
}

/// Pulses of one session, with the times of sending and reception after kNow.
class ReceiverOfPulses : public Receiver {
 protected:
  std::optional<ReceivedMessage> pulse(Duration sent_after, Duration received_after) {
    return receive(sender_.datagrams(wire::kPulseChannel, message(40), kNow + sent_after).at(0),
                   received_after);
  }
  /// The response to the last challenge.
  void respond(Duration sent_after, Duration received_after) {
    const auto response = encode(response_to(sent_.back(), sender_.sequence));
    receive(sender_.datagrams(wire::kSessionChannel, response, kNow + sent_after).at(0),
            received_after);
  }
  void respond_to_first_challenge() {
    EXPECT_FALSE(pulse(0s, 0s));
    respond(1ms, 1ms);
    ASSERT_TRUE(pulse(1s, 1s));
    ASSERT_EQ(sent_.size(), 1U) << "a recent message causes no challenge";
  }
  void expect_known_ages_after_the_clock_was_set(Duration back) {
    respond_to_first_challenge();
    const auto first = pulse(2s - back, 2s);
    ASSERT_TRUE(first) << "it may be late";
    EXPECT_GT(first->age, back - 5ms);
    ASSERT_EQ(sent_.size(), 2U);
    respond(2001ms - back, 2002ms);
    EXPECT_LE(pulse(2040ms - back, 2040ms).value().age, 2ms);
    EXPECT_EQ(sent_.size(), 2U);
  }
};

TEST_F(ReceiverOfPulses, reports_their_ages_after_a_clock_was_set_back_by_60_ms) {
  expect_known_ages_after_the_clock_was_set(60ms);
}

TEST_F(ReceiverOfPulses, reports_their_ages_after_a_clock_was_set_back_by_3_s) {
  expect_known_ages_after_the_clock_was_set(3s);
}

TEST_F(ReceiverOfPulses, keeps_the_comparison_of_clocks_when_messages_and_responses_are_late) {
  respond_to_first_challenge();
  ASSERT_TRUE(pulse(2s, 2300ms));
  ASSERT_EQ(sent_.size(), 2U);
  respond(2301ms, 2600ms);  // late by 299 ms of the 300 ms since the challenge
  EXPECT_GE(pulse(2700ms, 3s).value().age, 297ms);
}

TEST_F(Receiver, rejects_recorded_health_after_its_own_restart) {
  const RawDatagram recorded = sender_.datagrams("V3D_HEALTH_cap01", message(40)).at(0);
  for (int i = 0; i < 10; ++i) EXPECT_FALSE(receive(recorded, i * 500ms));
  EXPECT_FALSE(sent_.empty()) << "there was a challenge, but the session has ended";
}

TEST_F(Receiver, drops_its_challenges_when_it_removes_a_session) {
  receive(sender_.datagrams("V3D_HEALTH_cap01", message(40)).at(0));
  ASSERT_EQ(sent_.size(), 1U);
  for (size_t i = 0; i <= SessionReplayFilter::kMaxSessions; ++i) {
    EXPECT_TRUE(receive(Sender(key_).datagrams(wire::kEventChannel, message(40)).at(0)));
  }
  receive(response_of(sender_, sent_[0], 0));
  EXPECT_FALSE(receive(sender_.datagrams("V3D_HEALTH_cap01", message(40)).at(0)));
}

TEST_F(Receiver, responds_for_its_own_sessions_at_most_100_times_a_second) {
  wire::SessionMessage challenge;
  challenge.session = kOwnSession;
  challenge.nonce = 99;
  receive(sender_.datagrams(wire::kSessionChannel, encode(challenge)).at(0));
  ASSERT_EQ(sent_.size(), 1U);
  EXPECT_TRUE(sent_[0].is_answer);
  EXPECT_EQ(sent_[0].nonce, 99);
  EXPECT_EQ(sent_[0].newest, 41U);
  challenge.session = 78;
  receive(sender_.datagrams(wire::kSessionChannel, encode(challenge)).at(0));
  EXPECT_EQ(sent_.size(), 1U) << "session of another process";
  challenge.session = kOwnSession;
  for (int i = 0; i < 1000; ++i) {
    receive(sender_.datagrams(wire::kSessionChannel, encode(challenge)).at(0));
  }
  EXPECT_EQ(sent_.size(), 100U);
  Sender attacker(wire::StudioKey::make());
  receive(attacker.datagrams(wire::kSessionChannel, encode(challenge)).at(0), 2s);
  EXPECT_EQ(sent_.size(), 100U);
}

TEST_F(Receiver, drops_unknown_channels_and_sizes_before_any_hash) {
  EXPECT_FALSE(receive(sender_.datagrams("V3D_FRAME_invented", message(40)).at(0)));
  EXPECT_FALSE(receive(sender_.datagrams("LCM_SELF_TEST", message(40)).at(0)));
  EXPECT_FALSE(receive(sender_.datagrams(wire::kPulseChannel, message(5000)).at(0)));
  EXPECT_FALSE(receive(test::short_datagram(1, "V3D_COMMAND")));
  EXPECT_EQ(receiver_.counts().foreign, 2);
  EXPECT_EQ(receiver_.counts().oversized, 1);
  EXPECT_EQ(receiver_.counts().malformed, 1);
  EXPECT_EQ(authenticator_.counts().forged, 0);
}

TEST_F(Receiver, skips_all_fragments_of_a_message_without_subscription) {
  const auto preview = sender_.datagrams("V3D_PREVIEW_cam01", message(200'000));
  for (const RawDatagram& datagram : preview) EXPECT_FALSE(receive(datagram));
  RawDatagram changed = preview[1];
  changed.back() ^= 1;
  receive(changed);
  EXPECT_EQ(authenticator_.counts().forged, 0) << "not hashed";
}

TEST_F(Receiver, delivers_unverified_health_as_such_and_no_other_message) {
  Sender attacker(wire::StudioKey::make());
  const auto health = receive(attacker.datagrams("V3D_HEALTH_cap01", message(40)).at(0));
  ASSERT_TRUE(health);
  EXPECT_FALSE(health->is_accepted);
  EXPECT_EQ(health->bytes.size(), 40U);
  EXPECT_FALSE(receive(attacker.datagrams(wire::kEventChannel, message(40)).at(0)));
  EXPECT_FALSE(receive(attacker.datagrams("V3D_HEALTH_cap01", message(33'000)).at(0)))
      << "a stranger determines how much memory it needs";
  EXPECT_EQ(authenticator_.counts().forged, 3);
}

TEST(KeylessReceiver, reads_messages_with_and_without_trailers) {
  MessageAuthenticator authenticator;
  MessageReceiver receiver(ChannelList(studio()), authenticator,
                           [](std::string_view) { return true; });
  Sender sender(wire::StudioKey::make());
  const std::vector<uint8_t> sent(100'000, 77);
  std::optional<ReceivedMessage> got;
  auto datagrams = sender.datagrams("V3D_FRAME_cam01", sent);
  std::reverse(datagrams.begin(), datagrams.end());
  for (const auto& datagram : datagrams) got = receiver.receive(datagram, kSource, kReceiverNow);
  ASSERT_TRUE(got);
  EXPECT_TRUE(std::ranges::equal(got->bytes, sent));
  for (const OutgoingDatagram& plain : split_message(9, "V3D_FRAME_cam01", sent, false)) {
    RawDatagram bytes(plain.head().begin(), plain.head().end());
    bytes.insert(bytes.end(), plain.data.begin(), plain.data.end());
    got = receiver.receive(bytes, kSource, kReceiverNow);
  }
  ASSERT_TRUE(got);
  EXPECT_TRUE(std::ranges::equal(got->bytes, sent));
  EXPECT_EQ(got->session, kSource) << "without a session, the address of the sender";
}

TEST(AuthenticatingReceiver, rejects_all_messages_without_a_key) {
  MessageAuthenticator authenticator;
  authenticator.require_authentication();
  MessageReceiver receiver(ChannelList(studio()), authenticator,
                           [](std::string_view) { return true; });
  Sender sender(wire::StudioKey::make());
  for (const auto& datagram : sender.datagrams("V3D_FRAME_cam01", std::vector<uint8_t>(100'000))) {
    EXPECT_FALSE(receiver.receive(datagram, kSource, kReceiverNow));
  }
  EXPECT_EQ(authenticator.counts().unkeyed, 2);
  EXPECT_EQ(authenticator.counts().forged, 0);
}

/// Datagrams that an attacker without the key can send: noise, invented names, forged and changed
/// fragments, messages with a signature.
std::vector<RawDatagram> hostile_datagrams(Sender& studio_sender) {
  std::mt19937 random(7);
  std::vector<RawDatagram> all;
  Sender attacker(wire::StudioKey::make());
  const wire::SigningKey key = wire::SigningKey::make();
  const std::vector<uint8_t> bytes(100'000, 5);
  const std::vector<uint8_t> few(100, 5);
  for (int i = 0; i < 1000; ++i) {
    for (const char* channel : {wire::kEventChannel, wire::kPulseChannel, wire::kSessionChannel}) {
      all.push_back(attacker.signed_datagrams(channel, few, key).at(0));
    }
    all.push_back(test::short_datagram(random(), "V3D_COMMAND"));
    all.push_back(test::short_datagram(1, "V3D_FRAME_" + std::to_string(random()) + '\0'));
    RawDatagram huge = test::fragment_header(
        {.message_size = 256U << 20, .number = 0, .count = static_cast<uint16_t>(random())});
    test::put_text(huge, std::string("V3D_MESH") + '\0');
    all.push_back(huge);
    for (auto& datagram : attacker.datagrams("V3D_FRAME_cam01", bytes)) all.push_back(datagram);
    for (auto datagram : studio_sender.datagrams("V3D_FRAME_cam01", bytes)) {
      datagram[random() % datagram.size()] ^= static_cast<uint8_t>(1 << random() % 8);
      all.push_back(datagram);
    }
    RawDatagram noise(random() % 300);
    for (uint8_t& byte : noise) byte = static_cast<uint8_t>(random());
    all.push_back(noise);
  }
  return all;
}

TEST_F(Receiver, neither_allocates_for_forged_datagrams_nor_discards_a_message_for_them) {
  const auto sent = message(100'000);
  const auto frame = sender_.datagrams("V3D_FRAME_cam01", sent);
  Sender other(key_);
  const auto hostile = hostile_datagrams(other);
  authenticator_.report(std::string(200, 'x'));  // allocates memory for the text of the report
  EXPECT_FALSE(receive(frame[0]));
  const int64_t before = test::allocations();
  int64_t accepted = 0;
  for (const RawDatagram& datagram : hostile) accepted += receive(datagram) ? 1 : 0;
  EXPECT_EQ(test::allocations() - before, 0);
  EXPECT_GT(authenticator_.counts().forged, 1000);
  EXPECT_EQ(accepted, 0);
  EXPECT_TRUE(receive(frame[1])) << "the first half was kept";
}

TEST_F(Receiver, allocates_nothing_for_forged_datagrams_when_members_are_required) {
  authenticator_.members().require();  // signatures are verified only after the MAC
  Sender other(key_);
  const auto hostile = hostile_datagrams(other);
  authenticator_.report(std::string(200, 'x'));  // allocates memory for the text of the report
  const int64_t before = test::allocations();
  int64_t accepted = 0;
  for (const RawDatagram& datagram : hostile) accepted += receive(datagram) ? 1 : 0;
  EXPECT_EQ(test::allocations() - before, 0);
  EXPECT_GT(authenticator_.counts().forged, 1000);
  EXPECT_EQ(accepted, 0);
}

}  // namespace
}  // namespace v3d::bus
