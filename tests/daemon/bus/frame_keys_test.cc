// Tests of frame keys: live frames are accepted only from the node that owns the camera, although
// all senders have the studio key.
#include "daemon/bus/frame_keys.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <memory>

#include "daemon/bus/message_receiver.h"
#include "datagram_sender.h"
#include "support/allocation_count.h"
#include "wire/messages.h"

namespace v3d::bus {
namespace {

using namespace std::chrono_literals;
using test::datagrams_of;
using test::DatagramSender;
using test::kNow;
using test::kReceiverNow;
using test::RawDatagram;
using testing::AllOf;
using testing::ElementsAreArray;
using testing::HasSubstr;

using Datagrams = std::vector<RawDatagram>;

/// A studio whose members all have the studio key.
struct Members {
  Studio studio;
  wire::StudioKey studio_key = wire::StudioKey::make();
  wire::SigningKey cap01 = wire::SigningKey::make(), cap02 = wire::SigningKey::make(),
                   recon01 = wire::SigningKey::make(), recon02 = wire::SigningKey::make(),
                   guest = wire::SigningKey::make();

  Members() {
    studio.nodes = {{"cap01"}, {"cap02"}, {"recon01"}, {"recon02"}};
    studio.cameras.resize(2);
    studio.cameras[0].name = "cam01";
    studio.cameras[0].node = "cap01";
    studio.cameras[1].name = "cam02";
    studio.cameras[1].node = "cap02";
  }
  /// All members but `revoked`.
  wire::MemberList list(const std::string& revoked = "") const {
    wire::MemberList list{
        .studio = "kyoto",
        .serial = 1,
        .members = {{"cap01", wire::Role::kCapture, cap01.public_key()},
                    {"cap02", wire::Role::kCapture, cap02.public_key()},
                    {"recon01", wire::Role::kReconstruction, recon01.public_key()},
                    {"recon02", wire::Role::kReconstruction, recon02.public_key()},
                    {"guest", wire::Role::kViewer, guest.public_key()}}};
    std::erase_if(list.members, [&](const wire::Member& member) { return member.name == revoked; });
    return list;
  }
};

/// A node that sends frames.
class FrameNode {
 public:
  FrameNode(std::string name, const wire::SigningKey& key, const Members& members)
      : name_(std::move(name)), key_(key), main_(members.studio_key) {
    own_.adapt_to(members.list(), kReceiverNow.monotonic);
  }

  Datagrams announcement(Duration after = {}) {
    return main_.signed_datagrams(wire::frame_key_channel(name_), encode(own_.announcement()), key_,
                                  kNow + after);
  }
  /// A message with the MAC of the frame key.
  Datagrams frame(const std::string& channel, const wire::Bytes& message, Duration after = {}) {
    const auto sending = own_.sending(kReceiverNow.monotonic + after);
    return datagrams_of(sending->mac,
                        {.channel = channel,
                         .session = sending->session.number(),
                         .sequence = sending->session.take_sequence(),
                         .sent = kNow + after},
                        message);
  }
  Datagrams respond(wire::SessionMessage challenge, Duration after) {
    challenge.newest = main_.sequence - 1;
    challenge.is_answer = true;
    return main_.signed_datagrams(wire::kSessionChannel, encode(challenge), key_, kNow + after);
  }
  uint32_t frame_session() const { return own_.announcement().session; }
  OwnFrameKey& own() { return own_; }
  DatagramSender& main() { return main_; }

 private:
  const std::string name_;
  const wire::SigningKey key_;
  DatagramSender main_;
  OwnFrameKey own_;
};

/// A process that receives.
class Pc {
 public:
  Pc(const wire::SigningKey& key, const Members& members, bool wants_frames = true)
      : wants_frames_(wants_frames) {
    authenticator_.set_key(members.studio_key);
    authenticator_.members().require();
    authenticator_.members().set_signing_key(key);
    set_members(members.list());
    receiver_ = std::make_unique<MessageReceiver>(
        ChannelList(members.studio), authenticator_,
        [this](std::string_view channel) {
          return (wants_frames_ || !channel.starts_with(wire::kFramePrefix)) &&
                 !channel.starts_with(wire::kFrameKeyPrefix);
        },
        SessionPort{.send = [this](const wire::SessionMessage& m) { challenges_.push_back(m); }});
  }
  void set_members(const wire::MemberList& list) {
    authenticator_.members().set_members(std::make_shared<const wire::MemberList>(list));
  }
  std::optional<wire::Bytes> receive(const Datagrams& datagrams, Duration after = {}) {
    std::optional<wire::Bytes> got;
    for (const RawDatagram& bytes : datagrams) {
      const auto message =
          receiver_->receive(bytes, 1, {kReceiverNow.monotonic + after, kNow + after});
      if (message) got.emplace(message->bytes.begin(), message->bytes.end());
    }
    return got;
  }
  bool accepts(const Datagrams& datagrams, Duration after = {}) {
    return receive(datagrams, after).has_value();
  }
  /// Receives an announcement; the node responds to the challenge of its session.
  void learn_key_of(FrameNode& node, Duration after = {}) {
    const size_t before = challenges_.size();
    receive(node.announcement(after), after);
    if (challenges_.size() == before) return;
    receive(node.respond(challenges_.back(), after), after);
    receive(node.announcement(after), after);
  }
  RejectionCounts counts() const { return authenticator_.counts(); }
  std::string trouble() const { return authenticator_.trouble(Monotonic::now()); }
  MessageReceiver& receiver() { return *receiver_; }
  MessageAuthenticator& authenticator() { return authenticator_; }

 private:
  const bool wants_frames_;
  MessageAuthenticator authenticator_;
  std::vector<wire::SessionMessage> challenges_;
  std::unique_ptr<MessageReceiver> receiver_;
};

class FrameKeys : public testing::Test {
 protected:
  static constexpr char kCam01[] = "V3D_FRAME_cam01";
  static constexpr char kCam02[] = "V3D_FRAME_cam02";
  const wire::Bytes frame_ = wire::Bytes(100, 7);
  const wire::Bytes long_frame_ = wire::Bytes(300'000, 9);
  const Members members_;
  FrameNode cap01_{"cap01", members_.cap01, members_}, cap02_{"cap02", members_.cap02, members_};
  Pc recon01_{members_.recon01, members_};
};

TEST_F(FrameKeys, let_the_frames_of_their_node_arrive_in_any_order_of_fragments) {
  recon01_.learn_key_of(cap01_);
  EXPECT_EQ(recon01_.receive(cap01_.frame(kCam01, frame_)), frame_);
  EXPECT_EQ(recon01_.receive(cap01_.frame(kCam01, long_frame_)), long_frame_);
  Datagrams reversed = cap01_.frame(kCam01, long_frame_);
  std::ranges::reverse(reversed);
  EXPECT_EQ(recon01_.receive(reversed), long_frame_);
  EXPECT_FALSE(recon01_.accepts(reversed)) << "a replay";
  EXPECT_EQ(recon01_.counts().replayed, 1);
  EXPECT_EQ(recon01_.counts().forged, 0);
  EXPECT_EQ(recon01_.counts().not_signed, 0);
  EXPECT_EQ(recon01_.counts().unkeyed, 0);
}

TEST_F(FrameKeys, are_needed_beside_the_studio_key) {
  recon01_.learn_key_of(cap01_);
  DatagramSender forger(members_.studio_key);
  for (const wire::Bytes& frame : {frame_, long_frame_}) {
    EXPECT_FALSE(recon01_.accepts(forger.datagrams(kCam01, frame)));
  }
  EXPECT_EQ(recon01_.counts().not_signed, 2);
  EXPECT_THAT(recon01_.trouble(), AllOf(HasSubstr("V3D_FRAME_cam01 with the MAC of the studio key"),
                                        HasSubstr("only cap01 may send it, with its frame key")));
  forger.session = cap01_.frame_session();
  EXPECT_FALSE(recon01_.accepts(forger.datagrams(kCam01, frame_))) << "in the frame session";
  EXPECT_FALSE(recon01_.accepts(forger.signed_datagrams(kCam01, frame_, members_.cap01)));
  EXPECT_EQ(recon01_.counts().forged, 2);
}

TEST_F(FrameKeys, of_one_node_are_not_valid_for_the_cameras_of_another) {
  recon01_.learn_key_of(cap01_);
  recon01_.learn_key_of(cap02_);
  EXPECT_TRUE(recon01_.accepts(cap02_.frame(kCam02, long_frame_)));
  EXPECT_FALSE(recon01_.accepts(cap02_.frame(kCam01, frame_)));
  EXPECT_FALSE(recon01_.accepts(cap02_.frame(kCam01, long_frame_)));
  EXPECT_EQ(recon01_.counts().not_signed, 2);
  EXPECT_THAT(recon01_.trouble(),
              HasSubstr("V3D_FRAME_cam01 of member cap02 is rejected: only cap01 may send it"));
  EXPECT_EQ(recon01_.receiver().counts().incomplete, 0);
  EXPECT_TRUE(recon01_.accepts(cap01_.frame(kCam01, frame_)));
}

TEST_F(FrameKeys, are_valid_on_no_other_channel) {
  recon01_.learn_key_of(cap01_);
  for (const char* channel : {"V3D_EVENT", "V3D_MESH", "V3D_PREVIEW_cam01", "V3D_HEALTH_cap01"}) {
    const int64_t forged = recon01_.counts().forged;
    recon01_.accepts(cap01_.frame(channel, frame_));
    EXPECT_EQ(recon01_.counts().forged, forged + 1) << channel;
  }
}

TEST_F(FrameKeys, are_accepted_only_of_their_node) {
  recon01_.learn_key_of(cap01_);
  FrameNode forger("cap01", members_.cap02, members_);  // signs with the key of cap02
  recon01_.learn_key_of(forger);
  EXPECT_EQ(recon01_.counts().not_signed, 1);
  EXPECT_THAT(recon01_.trouble(), HasSubstr("V3D_FRAMEKEY_cap01 of member cap02 is rejected"));
  EXPECT_FALSE(recon01_.accepts(forger.frame(kCam01, frame_)));
  FrameNode viewer("cap01", members_.guest, members_);
  recon01_.learn_key_of(viewer);
  EXPECT_FALSE(recon01_.accepts(viewer.frame(kCam01, frame_)));
}

TEST_F(FrameKeys, that_were_recorded_are_not_accepted_after_a_restart) {
  const Datagrams first = cap01_.announcement(), second = cap01_.announcement();
  const Datagrams recorded = cap01_.frame(kCam01, frame_);
  recon01_.receive(first);
  for (int i = 0; i < 10; ++i) recon01_.receive(second, i * 500ms);
  EXPECT_FALSE(recon01_.accepts(recorded)) << "the session has not responded";
  recon01_.learn_key_of(cap01_, 10s);
  EXPECT_FALSE(recon01_.accepts(recorded, 10s)) << "it may have been received before the restart";
  EXPECT_EQ(recon01_.counts().replayed, 1);
  EXPECT_TRUE(recon01_.accepts(cap01_.frame(kCam01, frame_, 10s), 10s));
}

TEST_F(FrameKeys, that_are_old_are_accepted_for_two_seconds_more) {
  recon01_.learn_key_of(cap01_);
  cap01_.own().adapt_to(members_.list("recon02"), kReceiverNow.monotonic + 5s);
  const Datagrams early = cap01_.frame(kCam01, frame_, 5s), late = cap01_.frame(kCam01, frame_, 5s);
  recon01_.learn_key_of(cap01_, 5s);
  EXPECT_TRUE(recon01_.accepts(cap01_.frame(kCam01, frame_, 6s - 1ms), 6s)) << "the old key";
  EXPECT_TRUE(recon01_.accepts(cap01_.frame(kCam01, frame_, 6s), 6s)) << "the new key";
  EXPECT_TRUE(recon01_.accepts(early, 7s - 1ms));
  EXPECT_EQ(recon01_.counts().unkeyed, 0);
  EXPECT_FALSE(recon01_.accepts(late, 7s));
  EXPECT_EQ(recon01_.counts().unkeyed, 1);
}

TEST_F(FrameKeys, are_not_sent_to_a_revoked_reconstruction_node) {
  Pc recon02(members_.recon02, members_);
  recon02.learn_key_of(cap01_);
  EXPECT_TRUE(recon02.accepts(cap01_.frame(kCam01, frame_)));
  cap01_.own().adapt_to(members_.list("recon02"), kReceiverNow.monotonic);
  const wire::FrameKeyMessage message = cap01_.own().announcement();
  ASSERT_EQ(message.keys.size(), 1U);
  EXPECT_EQ(message.keys[0].recipient, id_of(members_.recon01.public_key()));
  recon02.learn_key_of(cap01_, 2s);
  EXPECT_FALSE(recon02.accepts(cap01_.frame(kCam01, frame_, 2s), 2s));
  EXPECT_EQ(recon02.counts().unkeyed, 1);
}

TEST_F(FrameKeys, of_a_revoked_node_are_rejected_at_once) {
  recon01_.learn_key_of(cap01_);
  EXPECT_TRUE(recon01_.accepts(cap01_.frame(kCam01, frame_)));
  recon01_.set_members(members_.list("cap01"));
  EXPECT_FALSE(recon01_.accepts(cap01_.frame(kCam01, frame_)));
  EXPECT_EQ(recon01_.counts().not_signed, 1);
  EXPECT_THAT(recon01_.trouble(), HasSubstr("V3D_FRAME_cam01 is rejected: the member list here"));
  recon01_.set_members(members_.list());
  EXPECT_TRUE(recon01_.accepts(cap01_.frame(kCam01, frame_)));
}

TEST_F(FrameKeys, of_nodes_with_the_same_session_number_do_not_disturb_each_other) {
  // cap02 announces the session of cap01 with a key of its own, and uses up its numbers.
  wire::FrameKeyMessage forged = cap02_.own().announcement();
  forged.session = cap01_.frame_session();
  recon01_.learn_key_of(cap02_);
  recon01_.receive(
      cap02_.main().signed_datagrams("V3D_FRAMEKEY_cap02", encode(forged), members_.cap02));
  for (uint32_t sequence = 0; sequence < 2000; sequence += 100) {
    recon01_.receive(datagrams_of(
        cap02_.own().sending(kReceiverNow.monotonic)->mac,
        {.channel = kCam02, .session = forged.session, .sequence = sequence, .sent = kNow},
        frame_));
  }
  recon01_.learn_key_of(cap01_);
  EXPECT_TRUE(recon01_.accepts(cap01_.frame(kCam01, long_frame_)));
  EXPECT_TRUE(recon01_.accepts(cap01_.frame(kCam01, frame_)));
  EXPECT_EQ(recon01_.counts().replayed, 0);
}

TEST_F(FrameKeys, cannot_be_used_up_by_messages_with_the_studio_key) {
  DatagramSender forger(members_.studio_key);
  forger.session = cap01_.frame_session();
  forger.sequence = 5000;
  recon01_.receive(forger.signed_datagrams(wire::kMeshChannel, frame_, members_.recon02));
  recon01_.learn_key_of(cap01_);
  recon01_.receive(forger.signed_datagrams(wire::kMeshChannel, frame_, members_.recon02));
  EXPECT_TRUE(recon01_.accepts(cap01_.frame(kCam01, long_frame_)));
}

TEST_F(FrameKeys, are_missing_on_other_nodes_whose_counts_do_not_call_the_frames_forged) {
  Pc viewer(members_.guest, members_), cap02(members_.cap02, members_, false);
  for (Pc* pc : {&viewer, &cap02}) {
    EXPECT_FALSE(pc->accepts(cap01_.frame(kCam01, long_frame_))) << "before the announcement";
    pc->learn_key_of(cap01_);
    const int64_t unkeyed = pc->counts().unkeyed;
    EXPECT_FALSE(pc->accepts(cap01_.frame(kCam01, frame_)));
    EXPECT_FALSE(pc->accepts(cap01_.frame(kCam01, long_frame_)));
    EXPECT_EQ(pc->counts().unkeyed, unkeyed + (pc == &viewer ? 2 : 0))
        << "counted for each frame, where a subscription wants it";
    EXPECT_EQ(pc->counts().forged, 0);
    EXPECT_EQ(pc->counts().not_signed, 0);
    EXPECT_EQ(pc->receiver().counts().incomplete, 0);
  }
}

TEST_F(FrameKeys, are_announced_without_a_subscription_and_not_delivered) {
  recon01_.learn_key_of(cap01_);
  EXPECT_FALSE(recon01_.accepts(cap01_.announcement()));
  EXPECT_EQ(recon01_.receiver().counts().malformed, 0);
  recon01_.receive(
      cap01_.main().signed_datagrams("V3D_FRAMEKEY_cap01", wire::Bytes(50), members_.cap01));
  EXPECT_EQ(recon01_.receiver().counts().malformed, 1);
}

TEST_F(FrameKeys, make_a_forged_frame_cost_no_allocation) {
  recon01_.learn_key_of(cap01_);
  const Datagrams real = cap01_.frame(kCam01, long_frame_);
  Datagrams forged = cap01_.frame(kCam01, long_frame_);
  for (RawDatagram& datagram : forged) datagram.back() ^= 1;
  DatagramSender attacker(wire::StudioKey::make());
  Datagrams unknown = attacker.datagrams(kCam01, long_frame_);
  recon01_.authenticator().report(std::string(200, 'x'));  // allocates memory for the text
  EXPECT_FALSE(recon01_.receiver().receive(real[0], 1, kReceiverNow));
  const int64_t before = test::allocations();
  for (const Datagrams* datagrams : {&forged, &unknown}) {
    for (const RawDatagram& datagram : *datagrams) {
      recon01_.receiver().receive(datagram, 1, kReceiverNow);
    }
  }
  EXPECT_EQ(test::allocations() - before, 0);
  EXPECT_EQ(recon01_.counts().forged, std::ssize(forged));
  EXPECT_EQ(recon01_.counts().unkeyed, std::ssize(unknown));
  EXPECT_TRUE(recon01_.accepts({real.begin() + 1, real.end()})) << "the first fragment was kept";
}

TEST(FramesWithoutMembers, are_accepted_with_the_studio_key_and_announcements_ignored) {
  const Members members;
  MessageAuthenticator authenticator;
  authenticator.set_key(members.studio_key);
  MessageReceiver receiver(
      ChannelList(members.studio), authenticator,
      [](std::string_view channel) { return channel != "V3D_FRAMEKEY_cap01"; });
  DatagramSender sender(members.studio_key);
  EXPECT_TRUE(
      receiver.receive(sender.datagrams("V3D_FRAME_cam01", wire::Bytes(9)).at(0), 1, kReceiverNow));
  FrameNode cap01("cap01", members.cap01, members);
  EXPECT_FALSE(receiver.receive(cap01.announcement().at(0), 1, kReceiverNow));
  EXPECT_EQ(authenticator.counts().forged, 0);
}

}  // namespace
}  // namespace v3d::bus
