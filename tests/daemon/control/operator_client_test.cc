// The operator's side of commands, on a real bus, with and without a member list.
#include "daemon/control/operator_client.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>

#include "base/core/error.h"
#include "daemon/bus/bus.h"
#include "support/child_process.h"
#include "support/message_of.h"
#include "support/temporary_folder.h"
#include "wire/member_list.h"
#include "wire/messages.h"
#include "wire/secret_keys.h"

namespace v3d::control {
namespace {

using test::becomes_true;
using test::within;

constexpr char kUrl[] = "udpm://239.255.76.67:7667?ttl=0";

/// A node that replies to each command with its next outcome, and repeats the last one.
class FakeNode {
 public:
  using Authenticate = std::function<wire::Bytes(const wire::ReplyMessage&)>;

  /// Its replies carry the MAC of the studio key.
  FakeNode(std::string node, const wire::StudioKey& key,
           std::vector<wire::ReplyMessage::Outcome> outcomes)
      : FakeNode(std::move(node), std::move(outcomes),
                 [key](const wire::ReplyMessage& reply) { return encode_with_mac(reply, key); }) {
    bus_.authenticator().set_key(key);
  }
  /// Replies "done", authenticated by `authenticate`, for studios with a member list.
  FakeNode(std::string node, const wire::StudioKey& key, Authenticate authenticate)
      : FakeNode(std::move(node), {wire::ReplyMessage::Outcome::kDone}, std::move(authenticate)) {
    bus_.authenticator().set_key(key);
  }

 private:
  FakeNode(std::string node, std::vector<wire::ReplyMessage::Outcome> outcomes,
           Authenticate authenticate)
      : node_(std::move(node)),
        outcomes_(std::move(outcomes)),
        authenticate_(std::move(authenticate)),
        bus_(kUrl) {
    registration_.emplace(
        bus_.subscribe(wire::kCommandChannel, [this](const bus::ReceivedMessage& received) {
          const auto signed_message = wire::split_signature(received.bytes);
          const auto command = wire::decode<wire::CommandMessage>(
              signed_message ? signed_message->message : received.bytes);
          const bool meant = command && std::find(command->to.begin(), command->to.end(), node_) !=
                                            command->to.end();
          if (meant) answer(*command);
        }));
  }
  void answer(const wire::CommandMessage& command) {
    wire::ReplyMessage reply;
    reply.node = node_;
    reply.command_sender = command.sender;
    reply.command_counter = command.counter;
    reply.outcome = outcomes_[std::min(answered_++, outcomes_.size() - 1)];
    bus_.publish_reply(authenticate_(reply));
  }

  const std::string node_;
  const std::vector<wire::ReplyMessage::Outcome> outcomes_;
  const Authenticate authenticate_;
  size_t answered_ = 0;
  bus::Bus bus_;
  // Last: its handler uses the other members.
  std::optional<bus::Bus::HandlerRegistration> registration_;
};

class OperatorClientTest : public testing::Test {
 protected:
  OperatorClientTest() {
    key_.save(folder_ / "studio.key");
    studio_.nodes = {{"cap01"}, {"recon01"}, {"desk"}};
    studio_.trigger.node = "cap01";
    studio_.reconstruction.nodes = {"recon01"};
    studio_.network.lcm_url = kUrl;
    studio_.network.key = folder_ / "studio.key";
  }

  const test::TemporaryFolder folder_;
  const wire::StudioKey key_ = wire::StudioKey::make();
  Studio studio_;
};

using enum wire::ReplyMessage::Outcome;

TEST_F(OperatorClientTest, commands_nodes_with_camera_trigger_or_reconstruction) {
  EXPECT_THAT(commanded_nodes(studio_), testing::ElementsAre("cap01", "recon01"));
}

TEST_F(OperatorClientTest, repeats_a_command_until_every_node_has_sent_a_final_reply) {
  const FakeNode capture("cap01", key_, {kPending, kPending, kDone});
  const FakeNode recon("recon01", key_, {kDone});
  OperatorClient client(studio_);
  int replies = 0;
  const Answer answer = client.command(wire::CommandMessage{}, within(20),
                                       [&](const wire::ReplyMessage&) { ++replies; });
  EXPECT_TRUE(answer.done());
  EXPECT_EQ(answer.replies.size(), 2U);
  EXPECT_EQ(replies, 5);  // pending once, ready twice, armed twice
}

TEST_F(OperatorClientTest, lists_silent_nodes) {
  const FakeNode capture("cap01", key_, {kDone});
  OperatorClient client(studio_);
  const auto lists_recon01 = [&] {  // a busy host may receive the other reply too late
    const Answer answer = client.command(wire::CommandMessage{}, within(1));
    EXPECT_FALSE(answer.done());
    return answer.silent == std::vector<std::string>{"recon01"};
  };
  EXPECT_TRUE(becomes_true(lists_recon01, within(60)));
}

TEST_F(OperatorClientTest, ignores_a_forged_done) {
  const FakeNode stranger("cap01", wire::StudioKey::make(), {kDone});
  OperatorClient client(studio_);
  const Answer answer = client.command(wire::CommandMessage{}, within(1));
  EXPECT_THAT(answer.silent, testing::ElementsAre("cap01"));
}

TEST_F(OperatorClientTest, needs_the_studio_key_to_command_but_not_to_monitor) {
  studio_.network.key = folder_ / "elsewhere.key";
  OperatorClient client(studio_);
  EXPECT_TRUE(client.health(Monotonic::now()).empty());
  EXPECT_THAT(
      test::message_of<InputError>([&] { client.command(wire::CommandMessage{}, within(1)); }),
      testing::HasSubstr("v3dctl key new"));
}

TEST_F(OperatorClientTest, counts_live_meshes_that_waited_too_long) {
  bus::Bus node(kUrl);
  node.authenticator().set_key(key_);
  OperatorClient client(studio_);
  EXPECT_EQ(client.dropped_meshes(), 0);
  EXPECT_FALSE(client.next_mesh(Monotonic::now()));
  wire::MeshMessage mesh;
  const auto is_queue_full = [&] {
    mesh.sent = Realtime::now();
    ++mesh.seq;
    node.publish_authenticated(wire::kMeshChannel, encode(mesh));
    return client.dropped_meshes() > 0;
  };
  EXPECT_TRUE(becomes_true(is_queue_full, within(60)));
  EXPECT_GT(mesh.seq, static_cast<int64_t>(OperatorClient::kMeshQueue));
}

/// A studio with a member list.
class MemberClientTest : public OperatorClientTest {
 protected:
  MemberClientTest() {
    const wire::SigningKey authority = wire::SigningKey::make();
    ada_.save(folder_ / "operator.key");
    studio_.network.members = folder_ / "members.toml";
    studio_.network.authority = authority.public_key().text();
    studio_.network.operator_key = folder_ / "operator.key";
    test::write_text(
        studio_.network.members,
        sign_member_list(
            {.studio = studio_.name,
             .serial = 1,
             .members = {{"ada", wire::Role::kOperator, ada_.public_key()},
                         {"guest", wire::Role::kViewer, guest_.public_key()},
                         {"cap01", wire::Role::kCapture, cap01_.public_key()},
                         {"recon01", wire::Role::kReconstruction, recon01_.public_key()}}},
            authority));
  }
  static FakeNode::Authenticate signed_by(const wire::SigningKey& key) {
    return [key](const wire::ReplyMessage& reply) { return sign_message(encode(reply), key); };
  }
  std::vector<std::string> silent_nodes() const {
    OperatorClient client(studio_);
    wire::CommandMessage abort;  // goes to all nodes, even when the trigger's node is silent
    abort.verb = wire::CommandVerb::kAbort;
    return client.command(abort, within(2)).silent;
  }

  const wire::SigningKey ada_ = wire::SigningKey::make(), guest_ = wire::SigningKey::make(),
                         cap01_ = wire::SigningKey::make(), recon01_ = wire::SigningKey::make();
};

TEST_F(MemberClientTest, accepts_signed_replies_of_nodes) {
  const FakeNode capture("cap01", key_, signed_by(cap01_));
  const FakeNode recon("recon01", key_, signed_by(recon01_));
  OperatorClient client(studio_);
  EXPECT_TRUE(client.command(wire::CommandMessage{}, within(60)).done());
}

TEST_F(MemberClientTest, ignores_a_node_that_replies_for_another) {
  const FakeNode capture("cap01", key_, signed_by(cap01_));
  const FakeNode forger("recon01", key_, signed_by(cap01_));
  const auto is_ignored = [&] { return silent_nodes() == std::vector<std::string>{"recon01"}; };
  EXPECT_TRUE(becomes_true(is_ignored, within(60)));
}

TEST_F(MemberClientTest, ignores_holders_of_the_studio_key_that_are_no_members) {
  const FakeNode capture("cap01", key_, signed_by(wire::SigningKey::make()));
  const FakeNode recon("recon01", key_, [&](const wire::ReplyMessage& reply) {
    return encode_with_mac(reply, key_);
  });
  EXPECT_THAT(silent_nodes(), testing::UnorderedElementsAre("cap01", "recon01"));
}

TEST_F(MemberClientTest, does_not_command_with_the_key_of_a_viewer) {
  std::filesystem::remove(folder_ / "operator.key");
  guest_.save(folder_ / "operator.key");
  OperatorClient client(studio_);
  EXPECT_THAT(
      test::message_of<InputError>([&] { client.command(wire::CommandMessage{}, within(1)); }),
      testing::AllOf(testing::HasSubstr("no operator has the public key of "),
                     testing::HasSubstr("v3dctl key enroll NAME --role operator")));
  std::filesystem::remove(folder_ / "operator.key");
  EXPECT_THAT(
      test::message_of<InputError>([&] { client.command(wire::CommandMessage{}, within(1)); }),
      testing::HasSubstr("operator.key"));
}

}  // namespace
}  // namespace v3d::control
