// Tests of member signatures: all senders have the studio key, and a message is accepted only from
// the member that may send it.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <map>
#include <memory>

#include "daemon/bus/credentials.h"
#include "daemon/bus/message_receiver.h"
#include "datagram_sender.h"
#include "wire/messages.h"

namespace v3d::bus {
namespace {

using namespace std::chrono_literals;
using test::DatagramSender;
using test::kNow;
using test::kReceiverNow;
using test::RawDatagram;
using testing::AllOf;
using testing::ElementsAreArray;
using testing::HasSubstr;

Studio studio() {
  Studio studio;
  studio.nodes = {{"cap01"}, {"cap02"}, {"recon01"}, {"recon02"}};
  studio.cameras.resize(2);
  studio.cameras[0].name = "cam01";
  studio.cameras[0].node = "cap01";
  studio.cameras[1].name = "cam02";
  studio.cameras[1].node = "cap02";
  studio.trigger.node = "cap01";
  return studio;
}

wire::Bytes health(const std::string& node) {
  wire::HealthMessage health;
  health.node = node;
  return encode(health);
}
wire::Bytes event(const std::string& node) {
  wire::EventMessage event;
  event.node = node;
  return encode(event);
}

class SignedMessages : public testing::Test {
 protected:
  SignedMessages() {
    authenticator_.set_key(studio_key_);
    authenticator_.members().require();
    set_members(all());
  }
  std::vector<wire::Member> all() const {
    return {{"ada", wire::Role::kOperator, key("ada").public_key()},
            {"cap01", wire::Role::kCapture, key("cap01").public_key()},
            {"cap02", wire::Role::kCapture, key("cap02").public_key()},
            {"recon01", wire::Role::kReconstruction, key("recon01").public_key()},
            {"recon02", wire::Role::kReconstruction, key("recon02").public_key()},
            {"guest", wire::Role::kViewer, key("guest").public_key()}};
  }
  void set_members(std::vector<wire::Member> members) {
    authenticator_.members().set_members(std::make_shared<const wire::MemberList>(
        wire::MemberList{.studio = "kyoto", .serial = ++serial_, .members = std::move(members)}));
  }
  const wire::SigningKey& key(const std::string& member) const { return keys_.at(member); }

  std::optional<ReceivedMessage> receive(const std::vector<RawDatagram>& datagrams,
                                         Duration delay = {}) {
    std::optional<ReceivedMessage> got;
    for (const RawDatagram& bytes : datagrams) {
      datagram_ = bytes;  // the result holds views into it
      got = receiver_.receive(datagram_, 1, {kReceiverNow.monotonic + delay, kNow + delay});
    }
    return got;
  }
  bool accepts(const std::vector<RawDatagram>& datagrams, Duration delay = {}) {
    const auto got = receive(datagrams, delay);
    return got && got->is_accepted;
  }
  /// `member` responds to the last challenge, in the session of `sender`.
  void respond(DatagramSender& sender, const std::string& member, uint32_t newest) {
    ASSERT_FALSE(sent_.empty());
    wire::SessionMessage response = sent_.back();
    response.newest = newest;
    response.is_answer = true;
    receive(sender.signed_datagrams(wire::kSessionChannel, encode(response), key(member)));
  }
  /// Whether `message` of `member` is accepted, in a new session that responds.
  bool is_accepted(const std::string& member, std::string_view channel,
                   const wire::Bytes& message) {
    DatagramSender sender(studio_key_);
    if (accepts(sender.signed_datagrams(channel, message, key(member)))) return true;
    if (sent_.empty() || sent_.back().session != sender.session) return false;
    respond(sender, member, sender.sequence - 1);
    return accepts(sender.signed_datagrams(channel, message, key(member)));
  }
  std::string trouble() const { return authenticator_.trouble(Monotonic::now()); }

  const wire::StudioKey studio_key_ = wire::StudioKey::make();
  const std::map<std::string, wire::SigningKey> keys_ = {
      {"ada", wire::SigningKey::make()},     {"cap01", wire::SigningKey::make()},
      {"cap02", wire::SigningKey::make()},   {"recon01", wire::SigningKey::make()},
      {"recon02", wire::SigningKey::make()}, {"guest", wire::SigningKey::make()},
      {"outsider", wire::SigningKey::make()}};
  int64_t serial_ = 0;
  MessageAuthenticator authenticator_;
  std::vector<wire::SessionMessage> sent_;
  RawDatagram datagram_;
  std::string_view unwanted_;
  MessageReceiver receiver_{
      ChannelList(studio()),
      authenticator_,
      [this](std::string_view channel) { return channel != unwanted_; },
      {.send = [this](const wire::SessionMessage& m) { sent_.push_back(m); }}};
};

TEST_F(SignedMessages, are_accepted_only_from_the_members_that_may_send_them) {
  struct Case {
    std::string channel;
    wire::Bytes message;
    std::vector<std::string> senders;
  };
  const wire::Bytes any(1000, 7);
  const std::vector<Case> cases = {{wire::kPulseChannel, any, {"cap01"}},
                                   {"V3D_HEALTH_cap02", health("cap02"), {"cap02"}},
                                   {"V3D_HEALTH_recon01", health("recon01"), {"recon01"}},
                                   {"V3D_PREVIEW_cam01", any, {"cap01"}},
                                   {"V3D_PREVIEW_cam02", any, {"cap02"}},
                                   {"V3D_SHARD_recon02", any, {"recon02"}},
                                   {"V3D_SHARD_cap01", any, {}},
                                   {"V3D_MESH_recon01", any, {"recon01"}},
                                   {"V3D_MESH_cap01", any, {}},
                                   {wire::kMeshChannel, any, {"recon01", "recon02"}},
                                   {wire::kEventChannel, event("cap02"), {"cap02"}},
                                   {wire::kEventChannel, event("recon01"), {"recon01"}},
                                   {wire::kEventChannel, event("ada"), {}},
                                   {wire::kEventChannel, event("guest"), {}},
                                   {wire::kEventChannel, any, {}}};
  for (const Case& c : cases) {
    for (const auto& [member, key] : keys_) {
      const bool is_expected = std::ranges::find(c.senders, member) != c.senders.end();
      EXPECT_EQ(is_accepted(member, c.channel, c.message), is_expected)
          << member << " on " << c.channel;
    }
  }
}

TEST_F(SignedMessages, are_delivered_without_their_signature_also_when_they_are_long) {
  for (const size_t size : {100, 1'000'000}) {
    const wire::Bytes sent(size, 5);
    DatagramSender sender(studio_key_);
    const auto got = receive(sender.signed_datagrams(wire::kMeshChannel, sent, key("recon01")));
    ASSERT_TRUE(got);
    EXPECT_THAT(got->bytes, ElementsAreArray(sent));
  }
  EXPECT_EQ(authenticator_.counts().not_signed, 0);
}

TEST_F(SignedMessages,
       of_another_member_are_counted_and_reported_with_sender_and_permitted_member) {
  DatagramSender sender(studio_key_);
  EXPECT_FALSE(accepts(sender.signed_datagrams(wire::kEventChannel, event("cap01"), key("cap02"))));
  EXPECT_EQ(authenticator_.counts().not_signed, 1);
  EXPECT_THAT(trouble(), AllOf(HasSubstr("V3D_EVENT of member cap02"), HasSubstr("only cap01")));
  EXPECT_FALSE(accepts(sender.signed_datagrams(wire::kMeshChannel, wire::Bytes(9), key("cap02"))));
  EXPECT_THAT(trouble(), HasSubstr("only a node with the role reconstruction may send it"));
  EXPECT_FALSE(
      accepts(sender.signed_datagrams(wire::kEventChannel, event("cap01"), key("outsider"))));
  EXPECT_THAT(trouble(), HasSubstr("which the member list here does not have"));
  EXPECT_FALSE(accepts(sender.datagrams(wire::kEventChannel, event("cap01"))));
  EXPECT_THAT(trouble(),
              HasSubstr("V3D_EVENT without a member's signature is rejected: only cap01"));
  EXPECT_EQ(authenticator_.counts().not_signed, 4);
  EXPECT_EQ(authenticator_.counts().forged, 0);
}

TEST_F(SignedMessages, are_rejected_when_the_signature_is_of_another_channel_number_or_time) {
  DatagramSender sender(studio_key_);
  const auto send_as = [&](const wire::MessageOrigin& origin) {
    const wire::Bytes bytes = sign_on_bus(wire::Bytes(50, 1), origin, key("recon01"));
    return accepts(sender.datagrams(wire::kMeshChannel, bytes));
  };
  EXPECT_TRUE(send_as(sender.origin(wire::kMeshChannel)));
  EXPECT_FALSE(send_as(sender.origin("V3D_MESH_recon01")));
  EXPECT_FALSE(send_as(sender.origin(wire::kMeshChannel, kNow - 1us)));
  wire::MessageOrigin other = sender.origin(wire::kMeshChannel);
  --other.sequence;
  EXPECT_FALSE(send_as(other)) << "the number of the previous message";
  other = sender.origin(wire::kMeshChannel);
  other.session ^= 1;
  EXPECT_FALSE(send_as(other));
  EXPECT_THAT(trouble(), HasSubstr("with a wrong signature"));
}

TEST_F(SignedMessages, are_not_accepted_as_commands_nor_commands_on_other_channels) {
  DatagramSender sender(studio_key_);
  const wire::Bytes as_command = sign_message(event("cap01"), key("cap01"));
  EXPECT_FALSE(accepts(sender.datagrams(wire::kEventChannel, as_command)));

  Credentials credentials;
  credentials.set_studio_key(studio_key_, kReceiverNow.monotonic);
  credentials.require_members();
  credentials.set_signing_key(key("cap01"));
  credentials.set_members(
      std::make_shared<const wire::MemberList>(wire::MemberList{"kyoto", 1, all()}));
  const auto is_command = [&](const wire::Bytes& bytes) {
    return credentials.open_command(bytes, kReceiverNow.monotonic).result ==
           OpenedCommand::Result::kAccepted;
  };
  const wire::Bytes command = encode(wire::CommandMessage{});
  EXPECT_TRUE(is_command(sign_message(command, key("ada"))));
  EXPECT_FALSE(is_command(sign_on_bus(command, sender.origin(wire::kCommandChannel), key("ada"))));
}

TEST_F(SignedMessages, are_rejected_when_they_are_cut_within_the_signature) {
  for (size_t cut = 1; cut <= wire::kMessageSignatureSize; ++cut) {
    DatagramSender sender(studio_key_);
    wire::Bytes bytes =
        sign_on_bus(event("cap01"), sender.origin(wire::kEventChannel), key("cap01"));
    bytes.resize(bytes.size() - cut);
    EXPECT_FALSE(accepts(sender.datagrams(wire::kEventChannel, bytes))) << cut;
  }
}

TEST_F(SignedMessages, are_rejected_as_soon_as_the_list_lacks_their_member) {
  const auto cap01_sends = [&] {
    return is_accepted("cap01", wire::kEventChannel, event("cap01"));
  };
  DatagramSender sender(studio_key_);
  const auto same_session_sends = [&] {
    return accepts(sender.signed_datagrams(wire::kEventChannel, event("cap01"), key("cap01")));
  };
  EXPECT_TRUE(cap01_sends());
  EXPECT_TRUE(same_session_sends());
  std::vector<wire::Member> others = all();
  std::erase_if(others, [](const wire::Member& member) { return member.name == "cap01"; });
  set_members(others);
  EXPECT_FALSE(cap01_sends());
  EXPECT_FALSE(same_session_sends()) << "in a session that was accepted before";
  others.push_back({"cap01", wire::Role::kViewer, key("cap01").public_key()});
  set_members(others);
  EXPECT_FALSE(same_session_sends()) << "with another role";
  set_members(all());
  EXPECT_TRUE(same_session_sends());
}

TEST_F(SignedMessages, are_all_rejected_before_there_is_a_list) {
  MessageAuthenticator authenticator;
  authenticator.set_key(studio_key_);
  authenticator.members().require();
  MessageReceiver receiver(ChannelList(studio()), authenticator,
                           [](std::string_view) { return true; });
  DatagramSender sender(studio_key_);
  const auto datagrams = sender.signed_datagrams(wire::kEventChannel, event("cap01"), key("cap01"));
  EXPECT_FALSE(receiver.receive(datagrams[0], 1, kReceiverNow));
  EXPECT_EQ(authenticator.counts().not_signed, 1);
}

TEST_F(SignedMessages, of_health_without_a_valid_signature_are_delivered_as_unverified) {
  DatagramSender sender(studio_key_), attacker(wire::StudioKey::make());
  for (const auto& datagrams :
       {sender.datagrams("V3D_HEALTH_cap01", health("cap01")),
        sender.signed_datagrams("V3D_HEALTH_cap01", health("cap01"), key("outsider")),
        attacker.signed_datagrams("V3D_HEALTH_cap01", health("cap01"), key("cap01"))}) {
    const auto got = receive(datagrams);
    ASSERT_TRUE(got);
    EXPECT_FALSE(got->is_accepted);
    EXPECT_THAT(got->bytes, ElementsAreArray(health("cap01")));
  }
}

// --- sessions -----------------------------------------------------------------------------------

/// Attack: a member replays signed messages of another member.
TEST_F(SignedMessages, that_were_recorded_are_rejected_when_another_member_responds) {
  DatagramSender cap01(studio_key_);
  const auto recorded = cap01.signed_datagrams("V3D_HEALTH_cap01", health("cap01"), key("cap01"));
  EXPECT_FALSE(accepts(recorded));
  respond(cap01, "cap02", static_cast<uint32_t>(-1));
  EXPECT_FALSE(accepts(recorded)) << "cap02 has responded for the session";
  respond(cap01, "guest", static_cast<uint32_t>(-1));
  EXPECT_FALSE(accepts(recorded));
  EXPECT_EQ(authenticator_.counts().not_signed, 0)
      << "a response without a challenge costs no verification";
  respond(cap01, "cap01", 0);
  EXPECT_FALSE(accepts(recorded)) << "it may have been received earlier";
  cap01.sequence = 1;
  EXPECT_TRUE(accepts(cap01.signed_datagrams("V3D_HEALTH_cap01", health("cap01"), key("cap01"))));
}

TEST_F(SignedMessages, of_an_hour_ago_are_rejected_when_another_member_responds) {
  DatagramSender cap01(studio_key_);
  cap01.sequence = 100;
  const auto recorded =
      cap01.signed_datagrams(wire::kEventChannel, event("cap01"), key("cap01"), kNow - 1h);
  // cap02 causes a challenge with a fragment in that session, and responds with the old time.
  DatagramSender cap02(studio_key_);
  cap02.session = cap01.session;
  EXPECT_FALSE(accepts(cap02.datagrams(wire::kMeshChannel, wire::Bytes(100'000), kNow - 1h)));
  ASSERT_EQ(sent_.size(), 1U);
  wire::SessionMessage forged = sent_.back();
  forged.is_answer = true;
  receive(cap02.signed_datagrams(wire::kSessionChannel, encode(forged), key("cap02"), kNow - 1h));
  EXPECT_TRUE(accepts(
      cap02.signed_datagrams(wire::kEventChannel, event("cap02"), key("cap02"), kNow - 1h)));
  EXPECT_FALSE(accepts(recorded));
  EXPECT_EQ(sent_.size(), 2U) << "cap01 gets a challenge";
}

TEST_F(SignedMessages, need_a_signed_response) {
  DatagramSender sender(studio_key_);
  const auto send = [&] {
    return accepts(sender.signed_datagrams("V3D_HEALTH_cap01", health("cap01"), key("cap01")));
  };
  EXPECT_FALSE(send());
  ASSERT_EQ(sent_.size(), 1U);
  wire::SessionMessage plain = sent_.back();
  plain.is_answer = true;
  receive(sender.datagrams(wire::kSessionChannel, encode(plain)));
  EXPECT_FALSE(send());
  const wire::MessageOrigin origin = sender.origin(wire::kEventChannel);
  receive(
      sender.datagrams(wire::kSessionChannel, sign_on_bus(encode(plain), origin, key("cap01"))));
  EXPECT_EQ(authenticator_.counts().not_signed, 1) << "signed for another channel";
  EXPECT_FALSE(send());
  respond(sender, "cap01", sender.sequence - 1);
  EXPECT_TRUE(send());
}

TEST_F(SignedMessages, of_an_operator_with_a_wrong_clock_are_accepted_after_its_response) {
  DatagramSender ada(studio_key_);
  const auto send = [&] {
    const wire::Bytes command = sign_message(encode(wire::CommandMessage{}), key("ada"));
    return accepts(ada.datagrams(wire::kCommandChannel, command, kNow - 1h));
  };
  const auto respond_as = [&](const std::string& member) {
    wire::SessionMessage response = sent_.back();
    response.newest = ada.sequence;
    response.is_answer = true;
    receive(ada.signed_datagrams(wire::kSessionChannel, encode(response), key(member), kNow - 1h));
  };
  EXPECT_FALSE(send());
  ASSERT_EQ(sent_.size(), 1U);
  respond_as("cap02");
  EXPECT_FALSE(send());
  respond_as("ada");
  EXPECT_TRUE(send());
}

// --- members that send in the session of another one ---------------------------------------------

/// Attack: a viewer has the studio key, so it can send with any session and sequence number.
class SuppressingViewer : public SignedMessages {
 protected:
  /// A sender in the session of `victim` whose numbers are far ahead.
  DatagramSender ahead_of(const DatagramSender& victim) {
    DatagramSender viewer(studio_key_);
    viewer.session = victim.session;
    viewer.sequence = victim.sequence + (ahead_ += 10'000);
    return viewer;
  }
  wire::Bytes stop() const { return sign_message(encode(wire::CommandMessage{}), key("ada")); }
  /// A short message as two fragments.
  std::vector<RawDatagram> in_two_fragments(const wire::MessageOrigin& origin,
                                            std::span<const uint8_t> message) const {
    const size_t half = message.size() / 2;
    std::vector<RawDatagram> fragments;
    for (const uint16_t number : {0, 1}) {
      RawDatagram bytes = test::fragment_header(
          {.sequence = origin.sequence,
           .message_size = static_cast<uint32_t>(message.size() + wire::kMacTrailerSize),
           .offset = static_cast<uint32_t>(number * half),
           .number = number});
      if (number == 0) test::put_text(bytes, std::string(origin.channel) + '\0');
      const auto data = number == 0 ? message.first(half) : message.subspan(half);
      wire::MacTrailer trailer{.session = origin.session, .sent = origin.sent};
      wire::DatagramMac(studio_key_).sign(bytes, data, trailer);
      bytes.insert(bytes.end(), data.begin(), data.end());
      const auto end = trailer.bytes();
      bytes.insert(bytes.end(), end.begin(), end.end());
      fragments.push_back(std::move(bytes));
    }
    return fragments;
  }

  uint32_t ahead_ = 0;
};

TEST_F(SuppressingViewer, does_not_keep_an_operator_from_commanding) {
  DatagramSender ada(studio_key_);
  const auto first = ada.datagrams(wire::kCommandChannel, stop());
  EXPECT_TRUE(accepts(first));
  receive(ahead_of(ada).datagrams(wire::kCommandChannel, wire::Bytes(100, 7)));
  EXPECT_TRUE(accepts(ada.datagrams(wire::kCommandChannel, stop()))) << "after a forged command";
  receive(ahead_of(ada).datagrams(wire::kCommandChannel, stop()));
  EXPECT_TRUE(accepts(ada.datagrams(wire::kCommandChannel, stop()))) << "after a recorded command";
  receive(ahead_of(ada).datagrams(wire::kReplyChannel, wire::Bytes(100'000, 7)));
  EXPECT_TRUE(accepts(ada.datagrams(wire::kCommandChannel, stop()))) << "after a long forged reply";
  EXPECT_TRUE(accepts(ada.datagrams(wire::kReplyChannel, wire::Bytes(100'000, 5))))
      << "a long reply";
  EXPECT_FALSE(accepts(first)) << "an equal datagram is a replay";
  EXPECT_EQ(authenticator_.counts().replayed, 1);
}

TEST_F(SuppressingViewer, does_not_suppress_messages_by_signing_in_the_same_session) {
  DatagramSender recon01(studio_key_);
  const auto sends = [&](size_t size) {
    return accepts(
        recon01.signed_datagrams(wire::kMeshChannel, wire::Bytes(size, 5), key("recon01")));
  };
  EXPECT_TRUE(sends(100));
  EXPECT_TRUE(accepts(
      ahead_of(recon01).signed_datagrams(wire::kMeshChannel, wire::Bytes(100, 5), key("recon02"))));
  EXPECT_TRUE(accepts(ahead_of(recon01).signed_datagrams(wire::kMeshChannel,
                                                         wire::Bytes(100'000, 5), key("recon02"))));
  EXPECT_TRUE(sends(100));
  EXPECT_TRUE(sends(100'000));
}

TEST_F(SuppressingViewer, does_not_suppress_messages_by_parts_of_a_message_without_subscription) {
  DatagramSender ada(studio_key_);
  EXPECT_TRUE(accepts(ada.datagrams(wire::kCommandChannel, stop())));
  unwanted_ = "V3D_PREVIEW_cam01";
  receive(ahead_of(ada).datagrams("V3D_PREVIEW_cam01", wire::Bytes(100'000, 7)));
  EXPECT_TRUE(accepts(ada.datagrams(wire::kCommandChannel, stop())));
}

TEST_F(SuppressingViewer, does_not_make_messages_old_by_a_later_time_or_by_a_response) {
  DatagramSender recon01(studio_key_);
  // recon02 causes a challenge of the session of recon01 and responds with a time of its own.
  DatagramSender recon02 = ahead_of(recon01);
  receive(recon02.datagrams(wire::kMeshChannel, wire::Bytes(100'000, 5), kNow + 1h));
  ASSERT_EQ(sent_.size(), 1U);
  wire::SessionMessage forged = sent_.back();
  forged.is_answer = true;
  receive(
      recon02.signed_datagrams(wire::kSessionChannel, encode(forged), key("recon02"), kNow + 1h));
  EXPECT_TRUE(accepts(recon02.signed_datagrams(wire::kMeshChannel, wire::Bytes(100, 5),
                                               key("recon02"), kNow + 1h)));
  EXPECT_TRUE(
      accepts(recon01.signed_datagrams(wire::kMeshChannel, wire::Bytes(100, 5), key("recon01"))));
  EXPECT_TRUE(accepts(
      recon01.signed_datagrams(wire::kMeshChannel, wire::Bytes(100'000, 5), key("recon01"))));
}

/// Attack: a member splits recorded health of another one, so that its first datagram does not show
/// the signer.
TEST_F(SuppressingViewer, does_not_make_health_accepted_by_splitting_it) {
  DatagramSender cap01(studio_key_);
  const wire::MessageOrigin origin = cap01.origin("V3D_HEALTH_cap01");
  const wire::Bytes recorded = sign_on_bus(health("cap01"), origin, key("cap01"));
  EXPECT_FALSE(accepts(in_two_fragments(origin, recorded)));
  ASSERT_EQ(sent_.size(), 1U);
  respond(cap01, "cap01", cap01.sequence);
  EXPECT_FALSE(accepts(in_two_fragments(origin, recorded)));
  cap01.sequence = 5;
  EXPECT_TRUE(accepts(in_two_fragments(
      cap01.origin("V3D_HEALTH_cap01"),
      sign_on_bus(health("cap01"), cap01.origin("V3D_HEALTH_cap01"), key("cap01")))));
}

// --- receivers that verify no signature ---------------------------------------------------------

TEST(UnsignedStudio, reads_messages_with_signatures_and_ignores_the_signatures) {
  const wire::StudioKey studio_key = wire::StudioKey::make();
  for (const bool has_key : {false, true}) {
    MessageAuthenticator authenticator;
    if (has_key) authenticator.set_key(studio_key);
    MessageReceiver receiver(ChannelList(studio()), authenticator,
                             [](std::string_view) { return true; });
    DatagramSender sender(studio_key);
    for (const size_t size : {100, 200'000}) {
      const wire::Bytes sent(size, 5);
      std::optional<ReceivedMessage> got;
      const auto datagrams =
          sender.signed_datagrams(wire::kMeshChannel, sent, wire::SigningKey::make());
      for (const auto& datagram : datagrams) got = receiver.receive(datagram, 1, kReceiverNow);
      ASSERT_TRUE(got);
      EXPECT_TRUE(got->is_accepted);
      EXPECT_THAT(got->bytes, ElementsAreArray(sent));
    }
  }
}

}  // namespace
}  // namespace v3d::bus
